"""Parameter bindings of SSP: values from sets and files, renamed and transformed by mappings."""

from collections.abc import Mapping as Names
from collections.abc import Sequence
from dataclasses import dataclass

from falsifier.core.model import Variable
from falsifier.errors import SpecError, did_you_mean
from falsifier.fmu.description import Unit, conversion
from falsifier.fmu.ssp.markup import Binding, Transformation, Value, parse_mappings, parse_values
from falsifier.fmu.ssp.package import Package


@dataclass(frozen=True, slots=True)
class Given:
    """A value that a package gives, before the variable that it is for is known.

    Attributes:
        value: the value in the parameter set.
        transformation: transformation by a mapping.
        units: units that the package defines.
    """

    value: Value
    transformation: Transformation
    units: Names[str, Unit]

    def number(self, variable: Variable, shown: str) -> float | str:
        """Return the value for a variable, in its unit.

        Raises:
            SpecError: if type or unit do not fit.
        """
        value = self.value.value
        if isinstance(value, str) and not self.value.is_item:
            if variable.kind != "string":
                raise SpecError(
                    f"{shown}: {value!r} is a text, but {variable.name!r} is of type {variable.kind}"
                )
            return value
        if isinstance(value, str):
            if value not in variable.literals:
                near = did_you_mean(value, variable.literals)
                raise SpecError(f"{shown}: {variable.name!r} has no item {value!r}; {near}")
            return float(variable.literals[value])
        if variable.kind == "string":
            raise SpecError(f"{shown}: {value:g} is a number, but {variable.name!r} is a text")
        if not self.transformation.suppress:
            found = conversion(self.value.unit, variable.unit, (self.units, self.units))
            if found is None:
                raise SpecError(
                    f"{shown}: the parameter {self.value.name} is in {self.value.unit}, {variable.name!r} in "
                    f"{variable.unit}, and the package defines no conversion; state the variable's unit"
                )
            value = found[0] * value + found[1]
        return self.transformation.factor * value + self.transformation.offset


def bound_values(bindings: Sequence[Binding], package: Package, units: Names[str, Unit]) -> dict[str, Given]:
    """Return the values of an element's bindings by name, relative to the element; later ones win.

    Raises:
        SpecError: if a file is missing or wrong.
    """
    found: dict[str, Given] = {}
    for binding in bindings:
        values = binding.values
        if binding.source:
            values = parse_values(package.text(binding.source), f"{package.shown}: {binding.source}")
        named = {binding.prefix + value.name: value for value in values}
        mappings = binding.mappings
        if binding.mapping_source:
            mappings = parse_mappings(
                package.text(binding.mapping_source), f"{package.shown}: {binding.mapping_source}"
            )
        if mappings is None:
            found |= {name: Given(value, Transformation(), units) for name, value in named.items()}
            continue
        for entry in mappings:
            if entry.source not in named:
                near = did_you_mean(entry.source, named)
                raise SpecError(
                    f"{package.shown}: a mapping names the unknown parameter {entry.source!r}; {near}"
                )
            found[entry.target] = Given(named[entry.source], entry.transformation, units)
    return found
