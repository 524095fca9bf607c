"""Where the inputs of a package's components get their values, and which values are set."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from falsifier.core.model import Variable
from falsifier.errors import SpecError, did_you_mean
from falsifier.fmu.description.model_description import Description
from falsifier.fmu.description.structure import Unit, conversion
from falsifier.fmu.ssp.package import Given, Transformation
from falsifier.fmu.systems.components import Component, Connection
from falsifier.stl.lexer import name_text

# Kinds of connectors from which others get their values, seen from outside of their element.
SOURCES = ("output", "calculatedParameter")

# A connector: path of its element, joined by dots (empty: the whole), and its name.
End = tuple[str, str]
# A conversion factor * value + offset that changes nothing.
_UNCHANGED = (1.0, 0.0)


@dataclass(slots=True)
class Elements:
    """What the system descriptions of a package contain, nested ones included, and what follows from it."""

    shown: str  # the package, for messages
    components: dict[str, Component] = field(default_factory=dict)  # by path
    descriptions: dict[str, Description] = field(default_factory=dict)  # what each component's FMU describes
    connectors: dict[End, tuple[str, str]] = field(default_factory=dict)  # kind and unit of each
    # Where the value of a connector comes from, in the direction of the signal.
    steps: dict[End, tuple[End, Transformation]] = field(default_factory=dict)
    units: dict[str, Unit] = field(default_factory=dict)
    # Those that an FMU defines, by component: another may mean something else by the same name.
    own_units: dict[str, Mapping[str, Unit]] = field(default_factory=dict)
    given: dict[str, Given] = field(default_factory=dict)  # values, by name
    notes: list[str] = field(default_factory=list)  # for the user

    def wrong(self, what: str) -> SpecError:
        """Return the error that names the package."""
        return SpecError(what, file=self.shown)

    def wiring(self) -> tuple[dict[str, Connection | str], tuple[Variable, ...], tuple[tuple[str, str], ...]]:
        """Return where the inputs of components get their values, and the inputs and outputs of the whole.

        An input of the whole is like its first target, or the first of whole numbers, within the limits of
        all. Outputs of the whole pass an output of a component unchanged; they come with its name.
        """
        connections: dict[str, Connection | str] = {}
        inputs: dict[End, Variable] = {}
        outputs: list[tuple[str, str]] = []
        for end, (kind, _) in self.connectors.items():
            if kind == "output" and not end[0]:
                source, (factor, offset) = self._traced(end)
                if (factor, offset) == _UNCHANGED and source[0] in self.components:
                    outputs.append((end[1], title_of(source)))
                    continue
                value = f"{name_text(title_of(source))}{_conversion_text(factor, offset)}"
                why = "nothing feeds it" if source == end else f"write {value} in formulas"
                self.notes.append(f"the output {end[1]} of the package is left out: {why}")
            elif kind == "input" and end[0] in self.components and end in self.steps:
                source, (factor, offset) = self._traced(end)
                connections[title_of(end)] = Connection(title_of(source), factor, offset)
                if (factor, offset) != _UNCHANGED:
                    shown = f"{title_of(source)} -> {title_of(end)}:{_conversion_text(factor, offset)}"
                    self.notes.append(f"{shown}, by units and transformations of the package")
                if source[0] not in self.components:
                    fed = self._passing(source, end, factor, offset)
                    inputs[source] = self._joint(inputs.get(source, fed), fed)
        return connections, tuple(inputs.values()), tuple(outputs)

    def values(self, inputs: Sequence[Variable], connected: Collection[str]) -> dict[str, float | str]:
        """Return the values of variables; those that name nothing are noted."""
        found: dict[str, float | str] = {}
        own, fed = {v.name: v for v in inputs}, {title_of(end) for end in self.steps}
        for name, given in self.given.items():
            targets = list(self._targets(name))
            if name in own:
                found[name] = self._value(given, own[name], self.units)
            elif not targets and name not in fed:  # what feeds a connector replaces its value
                self.notes.append(f"the parameter {name} of the package names nothing that can be set")
            for end, source, (factor, offset) in targets:
                if title_of(end) in connected:
                    continue
                if refusal := self.descriptions[end[0]].info[end[1]].refusal:
                    raise self.wrong(f"the parameter {title_of(end)} cannot be set: {refusal}")
                variable = self._passing(source, end, factor, offset)
                value = self._value(given, variable, self._units_of(source))
                found[title_of(end)] = value if isinstance(value, str) else factor * value + offset
        return found

    def _traced(self, end: End) -> tuple[End, tuple[float, float]]:
        """Follow the connections back from a connector; return where they begin, and the conversion."""
        chain: list[tuple[End, Transformation]] = []
        at = end
        while at in self.steps:
            source, change = self.steps[at]
            chain.append((at, change))
            at = source
            if any(at == passed for passed, _ in chain):
                circle = " -> ".join(title_of(passed) for passed, _ in chain)
                raise self.wrong(f"connectors feed each other in a circle: {circle}; remove one")
        if at != end and at[0] not in self.components and self.connectors[at][0] in SOURCES:
            raise self.wrong(
                f"{title_of(end)} is fed by the output {title_of(at)}, which nothing feeds; "
                "connect that one too"
            )
        factor, offset, unit, before, stating = 1.0, 0.0, self.connectors[at][1], at, at
        # Connectors do not say so; the variables at both ends do.
        of_fmus = [self.descriptions[e].info[name] for e, name in (at, end) if e in self.components]
        is_relative = any(variable.is_relative for variable in of_fmus)
        for target, change in reversed(chain):
            wanted = self.connectors[target][1]
            if not change.suppress:
                known = self._units_of(stating), self._units_of(target)
                found = conversion(unit, wanted, known, is_relative=is_relative)
                if found is None:
                    raise self.wrong(
                        f"{title_of(before)} is in {unit}, {title_of(target)} in {wanted}; the package "
                        "defines no conversion; define both units, or suppress the conversion"
                    )
                factor, offset = found[0] * factor, found[0] * offset + found[1]
            factor = change.factor * factor
            offset = change.factor * offset + change.offset
            unit, before, stating = wanted or unit, target, target if wanted else stating
        return at, (factor, offset)

    def _units_of(self, end: End) -> Mapping[str, Unit]:
        return {**self.units, **self.own_units.get(end[0], {})}

    def _joint(self, one: Variable, other: Variable) -> Variable:
        both = zip(one.limits, other.limits, strict=True)
        lows, highs = ([x for x in ends if x is not None] for ends in both)
        first = other if one.kind == "real" != other.kind else one
        if lows and highs and min(highs) < max(lows) and one is not other:
            self.notes.append(f"no value of {one.name} is within the limits of all that it feeds")
            return replace(first, low=one.low, high=one.high)
        return replace(first, low=max(lows, default=None), high=min(highs, default=None))

    def _passing(self, end: End, target: End, factor: float, offset: float) -> Variable:
        """Return a connector as a variable whose values a component gets as ``factor * value + offset``."""
        first = self.descriptions[target[0]].info[target[1]]
        low, high = first.low, first.high
        if (factor, offset) != _UNCHANGED:
            if first.kind != "real":
                raise self.wrong(f"{title_of(target)}: only reals can be converted; remove factor and offset")
            limits = [None if x is None else float(f"{(x - offset) / factor:.15g}") for x in (low, high)]
            low, high = limits if factor > 0 else limits[::-1]
        start = (float(first.start) - offset) / factor if isinstance(first.start, int | float) else 0.0
        unit = self.connectors.get(end, ("", ""))[1] or first.unit
        return replace(first, name=title_of(end), unit=unit, low=low, high=high, start=start, alias_of="")

    def _targets(self, name: str) -> Iterator[tuple[End, End, tuple[float, float]]]:
        """Yield the variables of components that a name means, the connector of this name, the conversion."""
        for element in sorted(self.components, key=len, reverse=True):
            local = name.removeprefix(f"{element}.")
            if local != name and local in self.descriptions[element].slots:
                yield (element, local), (element, local), _UNCHANGED
                return
        for end in self.steps:
            if end[0] in self.components and self.connectors[end][0] == "parameter":
                source, found = self._traced(end)
                if title_of(source) == name:
                    yield end, source, found

    def _value(self, given: Given, variable: Variable, units: Mapping[str, Unit]) -> float | str:
        """Return a value for a variable, in its unit, which is one of these."""
        value, change = given.value, given.transformation
        if isinstance(value, str) and not given.is_item:
            if variable.kind != "string":
                raise self.wrong(f"{value!r} is a text, but {variable.name!r} is of type {variable.kind}")
            return value
        if isinstance(value, str):
            if value not in variable.literals:
                near = did_you_mean(value, variable.literals)
                raise self.wrong(f"{variable.name!r} has no item {value!r}; {near}")
            return float(variable.literals[value])
        if variable.kind == "string":
            raise self.wrong(f"{value:g} is a number, but {variable.name!r} is a text")
        if not change.suppress:
            known = units, units
            found = conversion(given.unit, variable.unit, known, is_relative=variable.is_relative)
            if found is None:
                raise self.wrong(
                    f"the parameter {given.name} is in {given.unit}, {variable.name!r} in {variable.unit}, "
                    "and the package defines no conversion; state the variable's unit"
                )
            value = found[0] * value + found[1]
        value = change.factor * value + change.offset
        if wrong := variable.expected(value) or variable.excess(value, value):
            raise self.wrong(f"the parameter {given.name} is {value:g}: {wrong}; correct it")
        return value


def title_of(end: End) -> str:
    """Return the name of a connector in the whole system."""
    return f"{end[0]}.{end[1]}" if end[0] else end[1]


def _conversion_text(factor: float, offset: float) -> str:
    """Return what follows a name, as formulas have it: with digits enough to compute with."""
    added = f" {'-' if offset < 0 else '+'} {abs(offset):.15g}" if offset else ""
    return (f" * {factor:.15g}" if factor != 1.0 else "") + added
