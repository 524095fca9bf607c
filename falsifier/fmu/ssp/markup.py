"""The XML of SSP 1.0 and 2.0 as frozen values: system descriptions, parameter values, parameter mappings.

FMPy's reader is not used: it resolves entities, ignores transformations of connections (it looks for them in
another namespace), default experiments and inline mappings, and reads packages only, not ``.ssd`` files.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import isfinite
from typing import TypeVar
from xml.etree.ElementTree import Element

from falsifier.errors import SpecError
from falsifier.fmu.description.structure import Unit, read_units
from falsifier.fmu.description.variables import is_true
from falsifier.fmu.description.xml import read_xml

T = TypeVar("T")
_NAMESPACE = "{http://ssp-standard.org/SSP"
_VALUE_TAGS = ("Boolean", "String", "Enumeration", "Real", "Integer", "Float64", "Float32", *(
    f"{u}Int{b}" for u in ("", "U") for b in (8, 16, 32, 64)
))  # fmt: skip
_MAPPINGS = tuple(f"{kind}MappingTransformation" for kind in ("Boolean", "Integer", "Enumeration"))


@dataclass(frozen=True, slots=True)
class Transformation:
    """A linear transformation ``factor * value + offset``, and whether units are not converted before it."""

    factor: float = 1.0
    offset: float = 0.0
    suppress: bool = False


@dataclass(frozen=True, slots=True)
class Connector:
    """A port of a component or system; the type is the name of its element, empty if none is stated."""

    name: str
    kind: str
    unit: str
    type: str = ""


@dataclass(frozen=True, slots=True)
class Wire:
    """A connection of two connectors within a system; an element of None is the system itself."""

    start: tuple[str | None, str]
    end: tuple[str | None, str]
    transformation: Transformation


@dataclass(frozen=True, slots=True)
class Value:
    """A value of a parameter set: a number, or the text of a string or of an enumeration's item."""

    name: str
    value: float | str
    is_item: bool
    unit: str


@dataclass(frozen=True, slots=True)
class Mapping:
    """An entry of a parameter mapping."""

    source: str
    target: str
    transformation: Transformation


@dataclass(frozen=True, slots=True)
class Binding:
    """Parameter values for an element: inline, or in a file; with mappings, only what these name."""

    prefix: str
    source: str
    values: tuple[Value, ...]
    mapping_source: str
    mappings: tuple[Mapping, ...] | None


@dataclass(frozen=True, slots=True)
class Part:
    """A component (``source`` names its file) or a system of elements and connections."""

    name: str
    type: str
    source: str
    implementation: str
    connectors: tuple[Connector, ...]
    bindings: tuple[Binding, ...]
    parts: "tuple[Part, ...]" = ()
    wires: tuple[Wire, ...] = ()


@dataclass(frozen=True, slots=True)
class Structure:
    """A system description: the root system, units, default experiment in s."""

    root: Part
    units: dict[str, Unit]
    start_time: float | None
    stop_time: float | None


def parse_structure(text: bytes, shown: str) -> Structure:
    """Return the content of an ``.ssd`` file.

    Raises:
        SpecError: naming the file and what is wrong.
    """
    return _parsed(text, shown, "SystemStructureDescription", _structure)


def parse_values(text: bytes, shown: str) -> tuple[Value, ...]:
    """Return the content of an ``.ssv`` file; errors as for ``parse_structure``."""
    return _parsed(text, shown, "ParameterSet", lambda root: tuple(_values(root)))


def parse_mappings(text: bytes, shown: str) -> tuple[Mapping, ...]:
    """Return the content of an ``.ssm`` file; errors as for ``parse_structure``."""
    return _parsed(text, shown, "ParameterMapping", lambda root: tuple(_mappings(root)))


def _parsed(text: bytes, shown: str, expected: str, read: Callable[[Element], T]) -> T:
    root = read_xml(text, shown, SpecError)
    if not root.tag.startswith(_NAMESPACE) or _tag(root) != expected:
        raise SpecError(f"{shown}: expected the SSP element {expected}, got {root.tag}")
    try:
        return read(root)
    except KeyError as error:
        raise SpecError(f"{shown}: the attribute {error} is missing") from None
    except ValueError as error:
        raise SpecError(f"{shown}: {error}") from None


def _structure(root: Element) -> Structure:
    version = root.get("version", "")
    if version[:1] not in ("1", "2"):
        raise ValueError(f"SSP version {version!r}; export it as SSP 1.0 or 2.0")
    system = root.find("{*}System")
    if system is None:
        raise ValueError("it has no System")
    stated = {k: v for each in root.findall("{*}DefaultExperiment") for k, v in each.attrib.items()}
    start, stop = (_number(stated[name]) if name in stated else None for name in ("startTime", "stopTime"))
    return Structure(_part(system), read_units(root, tag="{*}Units/{*}Unit"), start, stop)


def _part(element: Element) -> Part:
    is_component = _tag(element) == "Component"
    for child in element.findall("{*}Elements/{*}SignalDictionaryReference"):
        raise ValueError(
            f"{child.get('name')!r} refers to a signal dictionary, which is not supported; connect the "
            "components directly"
        )
    name = element.attrib["name"] if is_component else element.get("name", "")
    source = element.attrib["source"] if is_component else ""
    if is_component and not (name and source):
        raise ValueError(f"a component has the name {name!r} and the source {source!r}; neither may be empty")
    return Part(
        name=name,
        type=element.get("type", "application/x-fmu-sharedlibrary") if is_component else "",
        source=source,
        implementation=element.get("implementation", "any"),
        connectors=tuple(map(_connector, element.findall("{*}Connectors/{*}Connector"))),
        bindings=tuple(map(_binding, element.findall("{*}ParameterBindings/{*}ParameterBinding"))),
        parts=tuple(_part(e) for e in element.findall("{*}Elements/*") if _tag(e) in ("Component", "System")),
        wires=tuple(map(_wire, element.findall("{*}Connections/{*}Connection"))),
    )


def _tag(element: Element) -> str:
    """Return the name of an element without its namespace."""
    return element.tag.rpartition("}")[2]


def _typed(element: Element) -> tuple[str, Element]:
    """Return the type and the element of a value or connector; an empty type if none is stated."""
    typed = next((child for child in element if _tag(child) in _VALUE_TAGS), None)
    return ("", Element("none")) if typed is None else (_tag(typed), typed)


def _unit(typed: Element) -> str:
    unit = typed.get("unit", "")
    return "" if unit == "1" else unit


def _connector(element: Element) -> Connector:
    kind, typed = _typed(element)
    return Connector(element.attrib["name"], element.attrib["kind"], _unit(typed), kind)


def _wire(element: Element) -> Wire:
    return Wire(
        (element.get("startElement"), element.attrib["startConnector"]),
        (element.get("endElement"), element.attrib["endConnector"]),
        _transformation(element),
    )


def _transformation(element: Element) -> Transformation:
    for child in element:
        if _tag(child) in _MAPPINGS:
            raise ValueError(f"the element {_tag(child)} is not supported; map the values inside a component")
    stated = {k: v for each in element.findall("{*}LinearTransformation") for k, v in each.attrib.items()}
    factor, offset = _number(stated.get("factor", "1")), _number(stated.get("offset", "0"))
    if factor == 0.0:
        raise ValueError("a LinearTransformation has the factor 0, which passes nothing on; set a parameter")
    return Transformation(factor, offset, is_true(element.get("suppressUnitConversion")))


def _binding(element: Element) -> Binding:
    for each in (element, *element.findall("{*}ParameterMapping")):
        if each.get("sourceBase", "SSD") != "SSD":
            raise ValueError("parameters inside an FMU (sourceBase) are not supported; put them beside it")
    inline = element.find("{*}ParameterValues/{*}ParameterSet")
    mapping = element.find("{*}ParameterMapping")
    entries = None if mapping is None else mapping.find("{*}ParameterMapping")
    return Binding(
        prefix=element.get("prefix", ""),
        source=element.get("source", ""),
        values=() if inline is None else tuple(_values(inline)),
        mapping_source="" if mapping is None else mapping.get("source", ""),
        mappings=None if mapping is None else tuple(_mappings(mapping if entries is None else entries)),
    )


def _values(element: Element) -> Iterator[Value]:
    for parameter in element.findall("{*}Parameters/{*}Parameter"):
        name = parameter.attrib["name"]
        kind, typed = _typed(parameter)
        if not kind:
            raise ValueError(f"the parameter {name!r} has no value of a known type")
        text, is_item = typed.attrib["value"], kind == "Enumeration"
        if is_item or kind == "String":
            yield Value(name, text, is_item, _unit(typed))
        else:
            number = float(is_true(text)) if kind == "Boolean" else _number(text)
            yield Value(name, number, is_item, _unit(typed))


def _mappings(element: Element) -> Iterator[Mapping]:
    for entry in element.findall("{*}MappingEntry"):
        yield Mapping(entry.attrib["source"], entry.attrib["target"], _transformation(entry))


def _number(text: str) -> float:
    number = float(text)
    if not isfinite(number):
        raise ValueError(f"{text!r} is not a finite number")
    return number
