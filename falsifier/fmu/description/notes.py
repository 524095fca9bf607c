"""What an FMU says of itself that the user should know: what is ignored, unusual or missing, in words."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from xml.etree.ElementTree import Element

from falsifier.core.model import Interface, Variable
from falsifier.fmu.description.slot import Slot

# Maximum number of names in one remark.
_SHOWN_NAMES = 10


def with_aliases_marked(
    variables: Sequence[Variable], slots: Mapping[str, Slot]
) -> tuple[tuple[Variable, ...], dict[str, Slot]]:
    """Mark all but one of the names of each variable that can be set: setting two of them would set it twice.

    Returns:
        The variables and their slots in the same order; aliases cannot be set.
    """
    first: dict[tuple[str, int, int], str] = {}
    # Inputs before parameters before start values: an input may share its reference with a local variable.
    by_rank = sorted(variables, key=_rank)
    marked: dict[str, Variable] = {}
    changed = dict(slots)
    for v in by_rank:
        if v.causality != "input" and not v.settable:
            continue
        slot = slots[v.name]
        known = first.setdefault((slot.type, slot.reference, slot.offset), v.name)
        if known == v.name:
            continue
        marked[v.name] = replace(v, alias_of=known, settable=False)
        changed[v.name] = replace(slot, refusal=f"it is another name of {known!r}; set that one")
    return tuple(marked.get(v.name, v) for v in variables), changed


def _rank(v: Variable) -> int:
    return 0 if v.causality == "input" else 1 if v.causality == "parameter" else 2


def input_clocks(root: Element) -> dict[int, str]:
    """Return the clocks that the importing tool would have to tick, by value reference (FMI 3)."""
    return {
        int(clock.attrib["valueReference"]): clock.attrib["name"]
        for clock in root.findall("ModelVariables/Clock")
        if clock.get("causality") == "input"
    }


def remarks(
    root: Element,
    variables: Sequence[Variable],
    *,
    start_time: float | None,
    tool: str,
    needs_tool: Sequence[Interface],
) -> tuple[str, ...]:
    """Return what the user should know about an FMU, one sentence each."""
    said = []
    if start_time:
        said.append(
            f"the default experiment starts at {start_time:g} s; here simulations start at 0 s and end at "
            "the stop time"
        )
    if unusable := _not_positive(root):
        said.append(f"ignored in the default experiment, as not greater than 0: {_listed(unusable)}")
    if needs_tool:
        said.append(needed_tool_text(tool, needs_tool))
    if clocks := tuple(input_clocks(root).values()):
        said.append(f"input clocks are ignored, so they never tick: {_listed(clocks)}")
    if ignored := [v.name for v in variables if v.is_clocked]:
        said.append(f"variables of input clocks are ignored: {_listed(ignored)}")
    if binary := [element.attrib["name"] for element in root.findall("ModelVariables/Binary")]:
        said.append(f"binary variables are ignored: {_listed(binary)}")
    if aliases := [f"{v.name} = {v.alias_of}" for v in variables if v.alias_of and v.causality == "input"]:
        said.append(f"two names of one input: {_listed(aliases)}; use the second")
    return tuple(said)


def _not_positive(root: Element) -> list[str]:
    stated = {k: v for e in root.findall("DefaultExperiment") for k, v in e.attrib.items()}
    times = {k: stated[k] for k in ("stopTime", "stepSize", "tolerance") if k in stated}
    return [f"{k} = {v}" for k, v in times.items() if float(v) <= 0.0]


def needed_tool_text(tool: str, interfaces: Sequence[Interface]) -> str:
    """Say that an FMU cannot run without the tool that exported it."""
    return (
        f"{' and '.join(interfaces)} needs the exporting tool to be installed on this machine"
        f"{f' ({tool})' if tool else ''}, as the FMU says with needsExecutionTool"
    )


def _listed(names: Sequence[str]) -> str:
    more = len(names) - _SHOWN_NAMES
    return ", ".join(names[:_SHOWN_NAMES]) + (f" and {more} more" if more > 0 else "")
