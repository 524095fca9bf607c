"""What an FMU says of itself that the user should know: what is ignored, unusual or missing, in words."""

from collections.abc import Sequence
from xml.etree.ElementTree import Element

from falsifier.core.model import Interface, Variable
from falsifier.fmu.description.variables import input_clocks

# Maximum number of names in one note.
_SHOWN_NAMES = 10


def notes(
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
