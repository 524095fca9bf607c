"""What users state of a system: components, connections, frame; and the description of the whole from it."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import ceil, floor
from os import PathLike
from pathlib import Path
from typing import get_args

from falsifier.core.arguments import finite, instance, one_of, path_of, positive
from falsifier.core.experiment import GRID_ROUNDING, common_part, exact
from falsifier.core.model import Interface, ModelInfo, Variable
from falsifier.errors import SpecError
from falsifier.fmu.description.archive import file_hash
from falsifier.fmu.description.model_description import Description
from falsifier.fmu.description.variables import Slot
from falsifier.fmu.process.network import SYSTEM, Extrapolation, Link, Member, Place, full_name

# Maximum number of connections in the description that people and language models read.
_SHOWN_LINKS = 40


@dataclass(frozen=True, slots=True, init=False)
class Component:
    """One FMU of a system.

    Attributes:
        fmu: path of the .fmu file.
        step: step of its own in s, an integer multiple of the communication step; None for that step.
        interface: ``co-simulation`` or ``model-exchange``; None: co-simulation if the FMU offers it.
        sha256: hash of the file.

    Raises:
        ModelError: if the file cannot be read.
        SpecError: if the path, the step or the interface is not as above, or the step not positive.
    """

    fmu: Path
    step: float | None
    interface: Interface | None
    sha256: str = field(init=False)

    def __init__(
        self, fmu: str | PathLike[str], step: float | None = None, interface: Interface | None = None
    ) -> None:
        path = path_of("fmu", fmu, "the path of an FMU").absolute()
        if step is not None:
            positive("step", step)
        if interface is not None:
            one_of("interface", interface, get_args(Interface))
        found = {"fmu": path, "step": step, "interface": interface, "sha256": file_hash(path)}
        for name, value in found.items():
            object.__setattr__(self, name, value)


@dataclass(frozen=True, slots=True)
class Connection:
    """Where the values of an input come from.

    Attributes:
        source: the output, as ``component.variable``.
        factor: factor of a conversion ``factor * value + offset``; with it, or an offset, units stay.
        offset: offset of the conversion.
        extrapolation: ``hold`` or ``linear``; None: that of the system.
    """

    source: str
    factor: float | None = None
    offset: float | None = None
    extrapolation: Extrapolation | None = None

    def __post_init__(self) -> None:
        instance("source", self.source, str, "an output, as component.variable")
        for name in ("factor", "offset"):
            if getattr(self, name) is not None:
                finite(f"{self.source}: {name}", getattr(self, name))
        if self.extrapolation is not None:
            one_of(f"{self.source}: extrapolation", self.extrapolation, get_args(Extrapolation))


@dataclass(frozen=True, slots=True)
class Frame:
    """What a system has as a whole, beyond its components; SSP packages have it.

    Attributes:
        inputs: inputs of the system, which connections may name as sources.
        outputs: other names of the components' outputs, with the names that they stand for.
        values: values of parameters, start values and inputs, set unless a simulation sets others.
        stop_time: stop time of the default experiment in s; None: the components'.
        notes: what the user should know, one sentence each.
    """

    inputs: tuple[Variable, ...] = ()
    outputs: tuple[tuple[str, str], ...] = ()
    values: tuple[tuple[str, float | str], ...] = ()
    stop_time: float | None = None
    notes: tuple[str, ...] = ()


def merged(
    name: str, members: Sequence[Member], links: Sequence[Link], frame: Frame, notes: Iterable[str]
) -> tuple[Description, dict[str, Place]]:
    """Return the description of a system, and where each of its variables is.

    A connected input is a local variable of the system: its component computes nothing from a value that
    anybody else could set.

    Raises:
        SpecError: if two variables would have the same name.
    """
    fed = {location(members, link.target): link for link in links}
    values = dict(frame.values)
    variables = [replace(v, start=values.get(v.name, v.start)) for v in frame.inputs]
    slots = {v.name: Slot(0, v.type or "Real") for v in frame.inputs}
    places = {v.name: Place(SYSTEM, v.name) for v in frame.inputs}
    for k, member in enumerate(members):
        for variable in member.description.info.variables:
            place = Place(k, variable.name)
            title = f"{member.name}.{variable.name}"
            if title in places:
                raise SpecError(
                    f"two variables of the system are named {title!r}; rename the component", key="components"
                )
            slot = member.description.slots[variable.name]
            link = fed.get(location(members, place)) if variable.causality == "input" else None
            alias = variable.alias_of and f"{member.name}.{variable.alias_of}"
            shown = replace(variable, name=title, alias_of=alias, start=values.get(title, variable.start))
            if link is not None:
                source = full_name(members, link.source)
                refusal = f"it is connected to {source}"
                shown = replace(shown, causality="local", settable=False, refusal=refusal)
            variables.append(shown)
            slots[title], places[title] = slot, place
    for other, meant in frame.outputs:
        if other not in places:
            variable = next(v for v in variables if v.name == meant)
            variables.append(replace(variable, name=other, causality="local", settable=False, alias_of=meant))
            slots[other], places[other] = slots[meant], places[meant]
    infos = [m.description.info for m in members]
    step_size, internal_step = _steps(members)
    stop_times = {i.stop_time for i in infos if i.stop_time is not None}
    info = ModelInfo(
        name=name,
        description=_description(members, links),
        fmi_version=" and ".join(sorted({i.fmi_version for i in infos})),
        interfaces=("co-simulation",),
        platforms=tuple(p for p in infos[0].platforms if all(p in i.platforms for i in infos)),
        tool=", ".join(dict.fromkeys(i.tool for i in infos if i.tool)),
        stop_time=frame.stop_time or (stop_times.pop() if len(stop_times) == 1 else None),
        step_size=step_size,
        internal_step=internal_step,
        tolerance=min((i.tolerance for i in infos if i.tolerance is not None), default=None),
        variables=tuple(variables),
        components=tuple(m.name for m in members),
        connections=_titles(members, links),
        notes=(
            *frame.notes,
            *notes,
            *(f"{m.name}: {note}" for m in members for note in m.description.info.notes),
        ),
    )
    return Description(info, "", {}, slots), places


def location(members: Sequence[Member], place: Place) -> tuple[int, str, int, int]:
    """Return what all names of a variable of a component have in common: where its value is.

    In FMI 2, a reference belongs to a type: a real and an integer may have the same.
    """
    slot = members[place.member].description.slots[place.name]
    return place.member, slot.type, slot.reference, slot.offset


def _description(members: Sequence[Member], links: Sequence[Link]) -> str:
    said: dict[str, list[str]] = {}
    for m in members:
        said.setdefault(m.description.info.description or m.name, []).append(m.name)
    parts = (", ".join(names) + (f" ({text})" if text not in names else "") for text, names in said.items())
    fed = [f"{source} -> {target}" for source, target in _titles(members, links)]
    shown = ", ".join(fed[:_SHOWN_LINKS]) + (", ..." if len(fed) > _SHOWN_LINKS else "")
    return f"System of {', '.join(parts)}" + (f". Connections: {shown}" if fed else "")


def _titles(members: Sequence[Member], links: Iterable[Link]) -> tuple[tuple[str, str], ...]:
    return tuple((full_name(members, link.source), full_name(members, link.target)) for link in links)


def _steps(members: Sequence[Member]) -> tuple[float | None, float | None]:
    """Return the default communication step, and the internal step of which it is a multiple.

    It is the largest that divides all of the components' own and exceeds no default of others. Only where no
    component has a step of its own, internal steps count; they may exceed a default.
    """
    own = [exact(m.step) for m in members if m.step]
    others = [m.description.info for m in members if not m.step]
    finest = min((i.step_size for i in others if i.step_size), default=None)
    if own:
        common = float(common_part(*own))
        return common if finest is None else common / max(1, ceil(common / finest - GRID_ROUNDING)), None
    if not (inverse := [1 / exact(i.internal_step) for i in others if i.internal_step]):
        return finest, None
    internal = float(1 / common_part(*inverse))
    return finest and internal * max(1, floor(finest / internal + GRID_ROUNDING)), internal
