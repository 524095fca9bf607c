"""The variables of an FMU, as its description declares them, and how to access each of them."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import product
from math import inf, isfinite, prod
from xml.etree.ElementTree import Element

from falsifier.core.model import Causality, Kind, Variable
from falsifier.errors import did_you_mean

# Element name -> (kind, type code). The type code names the FMU's get and set functions for the value.
_TYPES_1_2: Mapping[str, tuple[Kind, str]] = {
    "Real": ("real", "Real"),
    "Integer": ("integer", "Integer"),
    "Boolean": ("boolean", "Boolean"),
    "Enumeration": ("enumeration", "Integer"),
    "String": ("string", "String"),
}
_TYPES_3: Mapping[str, tuple[Kind, str]] = {
    "Float64": ("real", "Float64"),
    "Float32": ("real", "Float32"),
    **{f"{sign}Int{bits}": ("integer", f"{sign}Int{bits}") for sign in ("", "U") for bits in (8, 16, 32, 64)},
    "Boolean": ("boolean", "Boolean"),
    "Enumeration": ("enumeration", "Int64"),
    "String": ("string", "String"),
}
# Simulink writes the largest double for an open limit, Dymola 1e30 or more, OpenModelica 1e60, others INF.
_NO_LIMIT = 1e30
# Limits of what descriptions may contain; real ones stay far below.
_MAX_ELEMENTS = 1_000_000
LONGEST_NAME = 10_000
_LARGEST_REFERENCE = 2**32 - 1
_CAUSALITIES: Mapping[str, Causality] = {
    "input": "input",
    "output": "output",
    "parameter": "parameter",
    "structuralParameter": "parameter",
    "calculatedParameter": "calculatedParameter",
    "independent": "independent",
    **dict.fromkeys(("local", "dependent", "internal", "none"), "local"),
}
_NO_ELEMENT = Element("none")
# Causality, variability, and why the variable cannot be set; empty if it can.
_Role = tuple[Causality, str, str]
# Why variables of these causalities cannot be set.
_REFUSALS: Mapping[str, str] = {
    "structuralParameter": "it is a structural parameter; arrays have the sizes of its start value",
    "calculatedParameter": (
        "it is a calculated parameter; set the parameters from which the model calculates it"
    ),
    "independent": "it is the independent variable, time",
}


@dataclass(frozen=True, slots=True)
class Slot:
    """How to access one scalar in the FMU."""

    reference: int  # value reference of the variable or, for an element, of its array
    type: str  # type code, e.g. ``Real``, ``Float32``, ``Boolean``
    offset: int = 0  # position in the array in row-major order, 0 for scalars
    size: int = 1  # number of elements of the array, 1 for scalars
    negated: bool = False  # whether it is an FMI 1 alias with the opposite sign
    # Name in modelDescription.xml, if another: of an element, the array's; of an alias, the variable's.
    declared: str = ""


def read_variables(
    root: Element, major: int
) -> tuple[tuple[Variable, ...], dict[str, Slot], dict[int, tuple[float, ...]]]:
    """Return the scalar variables, elements of arrays among them, in the order of the description.

    Returns:
        The variables, how to access each by name, and the start values of all elements by value reference,
        for arrays only.

    Raises:
        LookupError, ValueError: if an attribute is missing or invalid, or a name occurs twice.
    """
    arrays: dict[int, tuple[float, ...]] = {}
    variables: list[Variable] = []
    slots: dict[str, Slot] = {}
    for variable, slot in _variables_3(root, arrays) if major == 3 else _variables_1_2(root, major):
        check_length(variable.name)
        if not variable.name:
            raise ValueError("a variable has an empty name")
        if variable.name in slots:
            raise ValueError(f"two variables are named {variable.name!r}")
        if not 0 <= slot.reference <= _LARGEST_REFERENCE:
            raise ValueError(f"value reference {slot.reference} of {variable.name!r} does not fit 32 bits")
        variables.append(variable)
        slots[variable.name] = slot
    return _with_aliases_marked(variables, slots), slots, arrays


@contextmanager
def about(element: Element) -> Iterator[None]:
    """Let errors raised within, which name an attribute, name the element, too."""
    try:
        yield
    except (LookupError, ValueError) as error:
        said = f"{error.args[0]} is missing" if isinstance(error, KeyError) else error
        tag = element.tag.rpartition("}")[2]
        raise ValueError(f"{tag} {element.get('name', '')!r}: {said}") from None


def whole(attributes: Mapping[str, str], name: str, default: str | None = None) -> int:
    """Return an attribute as a whole number; ValueError naming it if it is missing or none."""
    if (text := attributes.get(name, default)) is None:
        raise ValueError(f"{name} is missing")
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"{name} = {text[:40]!r}: expected a whole number") from None


def check_length(name: str) -> None:
    """Raise ValueError for a name that is too long to be shown."""
    if len(name) > LONGEST_NAME:
        raise ValueError(f"the name {name[:40]!r}... has more than {LONGEST_NAME} characters")


def _with_aliases_marked(variables: Sequence[Variable], slots: Mapping[str, Slot]) -> tuple[Variable, ...]:
    """Mark all names but one of each variable that can be set: setting two of them would set it twice."""
    first: dict[tuple[str, int, int], str] = {}
    marked: dict[str, Variable] = {}
    # Inputs before parameters before start values: an input may share its reference with a local variable.
    for v in sorted(variables, key=lambda v: (v.causality != "input", v.causality != "parameter")):
        slot = slots[v.name]
        if v.causality == "input" or v.settable:
            known = first.setdefault((slot.type, slot.reference, slot.offset), v.name)
            if known != v.name:
                refusal = f"it is another name of {known!r}; use that one"
                marked[v.name] = replace(v, alias_of=known, settable=False, refusal=refusal)
    return tuple(marked.get(v.name, v) for v in variables)


def input_clocks(root: Element) -> dict[int, str]:
    """Return the clocks that the importing tool would have to tick, by value reference (FMI 3)."""
    return {
        whole(clock.attrib, "valueReference"): clock.attrib["name"]
        for clock in root.findall("ModelVariables/Clock")
        if clock.get("causality") == "input"
    }


def _variables_1_2(root: Element, major: int) -> Iterator[tuple[Variable, Slot]]:
    types = {t.attrib["name"]: t for t in root.findall("TypeDefinitions/*") if "name" in t.attrib}
    elements = root.findall("ModelVariables/ScalarVariable")
    states = _states_2(root, elements)
    for position, element in enumerate(elements, start=1):
        with about(element):
            typed = next((child for child in element if child.tag in _TYPES_1_2), None)
            if typed is None:
                raise ValueError("it has no type")
            kind, code = _TYPES_1_2[typed.tag]
            definition = next(iter(types.get(typed.get("declaredType", ""), ())), _NO_ELEMENT)
            role = _role(element, major, has_start=typed.get("start") is not None)
            start, is_state = _start(kind, typed.attrib), position in states
            variable = _variable(element, typed, definition, (kind, code), role, start, is_state=is_state)
            reference = whole(element.attrib, "valueReference")
            negated = element.get("alias") == "negatedAlias"
            yield variable, Slot(reference, code, negated=negated)


def _states_2(root: Element, elements: list[Element]) -> set[int]:
    """Return the positions, counted from 1, of the continuous states; FMI 1 does not list them."""
    states = set()
    for unknown in root.findall("ModelStructure/Derivatives/Unknown"):
        if not 1 <= (index := whole(unknown.attrib, "index")) <= len(elements):
            raise ValueError(f"ModelStructure: index = {index}: there are {len(elements)} variables")
        derivative = elements[index - 1].find("Real")
        if derivative is not None and derivative.get("derivative"):
            states.add(whole(derivative.attrib, "derivative"))
    return states


class _ByReference(dict[int, Element]):
    def __missing__(self, reference: int) -> Element:
        raise ValueError(f"valueReference = {reference}: there is no such variable")


def _variables_3(root: Element, arrays: dict[int, tuple[float, ...]]) -> Iterator[tuple[Variable, Slot]]:
    types = {t.attrib["name"]: t for t in root.findall("TypeDefinitions/*")}
    elements = _ByReference()
    for element in root.findall("ModelVariables/*"):
        with about(element):
            elements[whole(element.attrib, "valueReference")] = element
    states = {
        whole(elements[whole(d.attrib, "valueReference")].attrib, "derivative")
        for d in root.findall("ModelStructure/ContinuousStateDerivative")
    }
    ticked = set(input_clocks(root))
    for reference, element in elements.items():
        if element.tag not in _TYPES_3:
            continue
        with about(element):
            kind, code = _TYPES_3[element.tag]
            definition = types.get(element.get("declaredType", ""), _NO_ELEMENT)
            starts = _starts_3(kind, element)
            default = "continuous" if kind == "real" else "discrete"
            role = _role(element, 3, default, has_start=bool(starts))
            clocks = {whole({"clocks": c}, "clocks") for c in element.get("clocks", "").split()}
            if clocks:
                role = (*role[:2], "it belongs to a clock; only the FMU itself may change it")
            shape = tuple(_extent(d, elements) for d in element.findall("Dimension"))
            count = prod(shape)
            if not 0 <= count <= _MAX_ELEMENTS:
                raise ValueError(
                    f"array {element.get('name')!r} has {count} elements, not 0 to {_MAX_ELEMENTS}"
                )
            if 1 < len(starts) < count:
                raise ValueError(f"start has {len(starts)} values for {count} elements")
            starts = starts * count if len(starts) == 1 else starts[:count]
            if shape and kind != "string":
                arrays[reference] = tuple(float(s or 0.0) for s in starts) if starts else (0.0,) * count
            variable = _variable(
                element, element, definition, (kind, code), role, is_state=reference in states
            )
            is_clocked = bool(clocks) and (clocks <= ticked or variable.causality == "input")
            names = [(variable.name, variable.description)]
            names += [(a.attrib["name"], a.get("description", "")) for a in element.findall("Alias")]
            for name, description in names:
                for offset, index in enumerate(product(*(range(1, n + 1) for n in shape))):
                    suffix = f"[{','.join(map(str, index))}]" if shape else ""
                    yield (
                        replace(
                            variable,
                            name=name + suffix,
                            description=description,
                            start=starts[offset] if starts else None,
                            is_clocked=is_clocked,
                        ),
                        Slot(reference, code, offset, count, declared=variable.name),
                    )


def _variable(
    element: Element,
    typed: Element,
    definition: Element,
    type_: tuple[Kind, str],
    role: _Role,
    start: float | str | None = None,
    *,
    is_state: bool,
) -> Variable:
    """Return a variable; what its declared type, the definition, says holds unless its own type says more."""
    attributes = {**definition.attrib, **typed.attrib}
    items = enumerate(definition.findall("Item"), start=1)
    return Variable(
        name=element.attrib["name"],
        kind=type_[0],
        causality=role[0],
        variability=role[1],
        unit=_unit(attributes.get("unit")),
        display_unit=_unit(attributes.get("displayUnit")),
        low=_limit(attributes, "min"),
        high=_limit(attributes, "max"),
        nominal=finite(attributes, "nominal"),
        start=start,
        settable=not role[2],
        refusal=role[2],
        is_state=is_state,
        literals={item.attrib["name"]: whole(item.attrib, "value", str(k)) for k, item in items},
        description=element.get("description", ""),
        type=type_[1],
        is_relative=is_true(attributes.get("relativeQuantity")),
    )


def _role(element: Element, major: int, default_variability: str = "continuous", *, has_start: bool) -> _Role:
    causality = element.get("causality", "local")
    variability = element.get("variability", default_variability)
    refusal = _REFUSALS.get(causality, "")
    if major == 1:
        if variability == "parameter":
            causality, variability = "parameter", "fixed"
        refusal = "" if has_start or causality == "input" else "it has no start value; the model computes it"
    elif causality == "parameter":
        variability = element.get("variability", "fixed")
    elif causality != "input" and not refusal:
        initial = element.get("initial", "exact" if has_start else "calculated")
        refusal = "" if initial in ("exact", "approx") else "the model computes its initial value"
    if variability == "constant":
        refusal = "it is a constant"
    if causality not in _CAUSALITIES:
        raise ValueError(f"causality = {causality!r}: {did_you_mean(causality, _CAUSALITIES)}")
    return _CAUSALITIES[causality], variability, refusal


def _extent(dimension: Element, elements: Mapping[int, Element]) -> int:
    if "start" in dimension.attrib:
        return whole(dimension.attrib, "start")
    return whole(elements[whole(dimension.attrib, "valueReference")].attrib, "start")


def _starts_3(kind: Kind, element: Element) -> tuple[float | str | None, ...]:
    if kind == "string":
        return tuple(s.get("value", "") for s in element.findall("Start"))
    return tuple(_start(kind, {"start": word}) for word in element.get("start", "").split())


def _start(kind: Kind, attributes: Mapping[str, str]) -> float | str | None:
    text = attributes.get("start")
    if text is None or kind == "string":
        return text
    return float(is_true(text)) if kind == "boolean" else real(attributes, "start")


def finite(attributes: Mapping[str, str], name: str) -> float | None:
    """Return the number of an attribute; None without one, and for NaN and infinity, which limit nothing."""
    found = real(attributes, name) if name in attributes else inf
    return found if isfinite(found) else None


def real(attributes: Mapping[str, str], name: str, default: str = "") -> float:
    """Return an attribute as a number; ValueError naming it if it is none."""
    text = attributes.get(name, default)
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{name} = {text[:40]!r}: expected a number") from None


def _limit(attributes: Mapping[str, str], name: str) -> float | None:
    """Return a min or max; None for the huge numbers with which tools write that there is none."""
    found = finite(attributes, name)
    return None if found is None or not abs(found) < _NO_LIMIT else found


def is_true(text: str | None) -> bool:
    """Whether an attribute says yes."""
    return text is not None and text.strip() in ("true", "1")


def _unit(text: str | None) -> str:
    """Return a unit; empty for 1, which FMUs use for dimensionless variables."""
    return "" if text in (None, "1") else str(text)
