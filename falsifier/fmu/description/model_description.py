"""modelDescription.xml, the description of an FMU, as frozen values.

Element and attribute names are those of the FMI standards 1.0.1, 2.0.5 and 3.0.2.
"""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from math import isfinite
from pathlib import Path
from xml.etree.ElementTree import Element

from falsifier.core.arguments import path_of
from falsifier.core.model import INTERFACE_TAGS, Interface, ModelInfo, Variable
from falsifier.core.words import first_few
from falsifier.errors import ModelError, ModelFileError, did_you_mean
from falsifier.fmu.description import archive
from falsifier.fmu.description.libraries import Libraries, can_run_windows, find_libraries, platforms
from falsifier.fmu.description.variables import (
    LONGEST_NAME,
    Slot,
    check_length,
    finite,
    input_clocks,
    is_true,
    read_variables,
    whole,
)
from falsifier.fmu.description.xml import read_xml

# FMI 2 and FMI 3 write it differently.
_SAVING = ("canGetAndSetFMUstate", "canGetAndSetFMUState")
_NO_LIBRARIES = Libraries({}, {}, {}, ())


@dataclass(frozen=True, slots=True)
class Description:
    """Contents of a modelDescription.xml."""

    info: ModelInfo  # what other packages need
    token: str  # GUID (FMI 1 and 2) or instantiation token (FMI 3)
    identifiers: Mapping[Interface, str]  # model identifier by interface
    slots: Mapping[str, Slot]  # how to access each scalar variable, by name
    libraries: Libraries = _NO_LIBRARIES  # its libraries for this platform and for Windows
    # Start values of all elements by value reference, for arrays only.
    arrays: Mapping[int, tuple[float, ...]] = field(default_factory=dict)
    states: int = 0  # number of continuous states (FMI 1 and 2; FMI 3 reports it at run time)
    indicators: int = 0  # number of event indicators (FMI 1 and 2)
    event_mode: bool = False  # whether the co-simulation interface supports event mode (FMI 3)
    needs_tool: tuple[Interface, ...] = ()  # names of interfaces that need the exporting tool to be installed
    saves_state: tuple[Interface, ...] = ()  # names of interfaces whose state can be saved and restored
    once: tuple[Interface, ...] = ()  # names of interfaces of which a process can have one instance only

    @property
    def major(self) -> int:
        """Major FMI version: 1, 2 or 3."""
        return int(self.info.fmi_version[0])

    def needs_wine(self, interface: Interface) -> bool:
        """Whether the only library that this machine can run is the one for Windows."""
        libraries = self.libraries
        return can_run_windows() and interface not in libraries.here and interface in libraries.windows

    def slot(self, name: str) -> Slot:
        """Return how to access a numeric variable; ModelError if its name is unknown, or it is a string."""
        if name not in self.slots:
            raise ModelError(f"{self.info.name}: no variable {name!r}; {did_you_mean(name, self.slots)}")
        if self.slots[name].type == "String":
            raise ModelError(f"{self.info.name}: {name!r} is a string; use a numeric variable")
        return self.slots[name]


def read_info(path: str | Path) -> ModelInfo:
    """Read the description of an FMU without loading its library.

    Raises:
        ModelError: if the file is not an FMU, or not one of FMI 1, 2 or 3.
    """
    return read_description(path).info


def read_description(path: str | Path) -> Description:
    """Return an FMU's description; a changed file is read again; ModelError as of ``read_info``."""
    path = path_of("path", path, "the path of an FMU")
    return describe(path, archive.file_hash(path))


@lru_cache(maxsize=32)
def describe(path: Path, sha256: str) -> Description:
    """Return the description, cached, of an FMU with this hash; ModelError as of ``read_info``."""
    text = archive.read_entry(path, "modelDescription.xml")
    described = parse(read_xml(text, f"{path}: modelDescription.xml", ModelFileError), name=str(path))
    libraries = find_libraries(path, described.info.fmi_version, described.identifiers)
    notes, supported = (*described.info.notes, *libraries.notes), platforms(archive.entry_names(path))
    info = replace(described.info, notes=notes, platforms=supported)
    return replace(described, info=info, libraries=libraries)


def parse(root: Element, *, name: str) -> Description:
    """Return the description in a parsed modelDescription.xml of a file that errors call by this name.

    Raises:
        ModelError: if the FMI version is not 1, 2 or 3, or an attribute is missing or invalid.
    """
    version = root.get("fmiVersion", "")
    if version[:1] not in ("1", "2", "3"):
        raise ModelError(f"{name}: fmiVersion is {version!r}; export it as FMI 1.0, 2.0 or 3.0")
    for element in root.iter():
        text = element.get("description", "")
        if len(text) > LONGEST_NAME:
            element.set("description", f"{text[:LONGEST_NAME]} ...")
    try:
        return _parse(root, version)
    except (KeyError, ValueError) as error:
        said = f"{error.args[0]} is missing" if isinstance(error, KeyError) else error
        raise ModelFileError(f"{name}: modelDescription.xml does not follow FMI {version}: {said}") from error


def _parse(root: Element, version: str) -> Description:
    major = int(version[0])
    interfaces = _interfaces(root, major)
    identifiers = {interface: stated["modelIdentifier"] for interface, stated in interfaces.items()}
    if folder := next((each for each in identifiers.values() if re.search(r"[/\\]", each)), None):
        raise ValueError(f"modelIdentifier = {folder!r}: expected the name of a library, without a folder")
    needs_tool = _declaring(interfaces, "needsExecutionTool")
    tool = root.get("generationTool", "")
    for name in (root.attrib["modelName"], *identifiers.values(), tool):
        check_length(name)
    variables, slots, arrays = read_variables(root, major)
    experiment = {k: v for element in root.findall("DefaultExperiment") for k, v in element.attrib.items()}
    info = ModelInfo(
        name=root.attrib["modelName"],
        description=root.get("description", ""),
        fmi_version=version,
        interfaces=tuple(identifiers),
        tool=tool,
        start_time=finite(experiment, "startTime"),
        stop_time=_positive(experiment, "stopTime"),
        step_size=_positive(experiment, "stepSize"),
        internal_step=_positive(interfaces.get("co-simulation", {}), "fixedInternalStepSize"),
        tolerance=_positive(experiment, "tolerance"),
        variables=tuple(map(_without_impossible_limits, variables)),
        notes=_notes(root, variables, slots, experiment, tool=tool, needs_tool=needs_tool),
    )
    return Description(
        info=info,
        token=root.get("instantiationToken" if major == 3 else "guid", ""),
        identifiers=identifiers,
        slots=slots,
        arrays=arrays,
        states=_number_of_states(root, major),
        indicators=whole(root.attrib, "numberOfEventIndicators", "0"),
        event_mode=is_true(interfaces.get("co-simulation", {}).get("hasEventMode")),
        needs_tool=needs_tool,
        saves_state=_declaring(interfaces, *_SAVING),
        once=_declaring(interfaces, "canBeInstantiatedOnlyOncePerProcess"),
    )


def _declaring(
    interfaces: Mapping[Interface, Mapping[str, str]], *capabilities: str
) -> tuple[Interface, ...]:
    """Return the interfaces that declare one of these capabilities."""
    return tuple(i for i, stated in interfaces.items() if any(is_true(stated.get(c)) for c in capabilities))


def _number_of_states(root: Element, major: int) -> int:
    if major == 1:
        return whole(root.attrib, "numberOfContinuousStates", "0")
    return len(root.findall("ModelStructure/Derivatives/Unknown"))


def _interfaces(root: Element, major: int) -> dict[Interface, Mapping[str, str]]:
    """Return the attributes of the interfaces that an FMU offers."""
    if major > 1:
        found = {interface: root.find(tag) for interface, tag in INTERFACE_TAGS.items()}
        return {interface: dict(e.attrib) for interface, e in found.items() if e is not None}
    own = {"modelIdentifier": root.attrib["modelIdentifier"]}
    implementation = root.find("Implementation")
    if implementation is None:
        return {"model-exchange": own}
    needs_tool = implementation.find("CoSimulation_Tool") is not None
    return {"co-simulation": {**own, "needsExecutionTool": str(needs_tool).lower()}}


def _positive(experiment: Mapping[str, str], name: str) -> float | None:
    """Return a time or tolerance of the default experiment; None if no simulation could use it."""
    found = finite(experiment, name)
    return found if found is not None and found > 0.0 else None


def _notes(
    root: Element,
    variables: Sequence[Variable],
    slots: Mapping[str, Slot],
    experiment: Mapping[str, str],
    *,
    tool: str,
    needs_tool: Sequence[Interface],
) -> tuple[str, ...]:
    """Return what the user should know about an FMU, one sentence each."""
    said = []
    if start_time := finite(experiment, "startTime"):
        said.append(
            f"the default experiment starts at {start_time:g} s; here simulations start at 0 s and end at "
            "the stop time"
        )
    times = {k: experiment[k] for k in ("stopTime", "stepSize", "tolerance") if k in experiment}
    if unusable := [f"{k} = {v}" for k, v in times.items() if float(v) <= 0.0]:
        said.append(f"ignored in the default experiment, as not greater than 0: {first_few(unusable)}")
    if needs_tool:
        said.append(needed_tool_text(tool, needs_tool))
    if clocks := tuple(input_clocks(root).values()):
        said.append(f"input clocks are ignored, so they never tick: {first_few(clocks)}")
    if ignored := [v.name for v in variables if v.is_clocked]:
        said.append(f"variables of clocks are ignored: {first_few(ignored)}")
    if binary := [element.attrib["name"] for element in root.findall("ModelVariables/Binary")]:
        said.append(f"binary variables are ignored: {first_few(binary)}")
    if aliases := [f"{v.name} = {v.alias_of}" for v in variables if v.alias_of and v.causality == "input"]:
        said.append(f"two names of one input: {first_few(aliases)}; use the second")
    if doubtful := [*_surplus(root, slots), *(text for v in variables if (text := _doubt(v)))]:
        said.append(f"the description contradicts itself: {first_few(doubtful)}")
    return tuple(said)


def _surplus(root: Element, slots: Mapping[str, Slot]) -> Iterator[str]:
    """Say what there is more of than can be used: items of one name, and start values of an array."""
    for definition in root.iterfind("TypeDefinitions//*"):
        count = Counter(item.attrib["name"] for item in definition.findall("Item"))
        for name in (name for name, times in count.items() if times > 1):
            yield f"an enumeration has {count[name]} items named {name!r}, of which the last counts"
    sizes = {slot.declared: slot.size for slot in slots.values()}
    for element in root.iterfind("ModelVariables/*[Dimension]"):
        size = sizes.get(name := element.attrib["name"], 0)
        given = len(element.get("start", "").split()) or len(element.findall("Start"))
        if given > size > 0:
            yield f"{name!r} has {given} start values for {size} elements, so the last ones are ignored"


def _without_impossible_limits(v: Variable) -> Variable:
    return v if v.low is None or v.high is None or v.low <= v.high else replace(v, low=None, high=None)


def _doubt(v: Variable) -> str:
    """Say what of a variable's limits and start value cannot be meant; empty if nothing is wrong."""
    if v.low is not None and v.high is not None and v.low > v.high:
        return f"min = {v.low:g} of {v.name!r} is greater than max = {v.high:g}, so both are ignored"
    if (start := v.start_number) is None:
        return ""
    if not isfinite(start):
        return f"start of {v.name!r} is {start}"
    if v.type in ("Int64", "UInt64") and abs(start) >= 2**53:  # as the standard has it, but no exact double
        return ""
    excess, expected = v.excess(start, start), v.expected(start)
    return f"start = {start:g} {excess}" if excess else expected and f"start = {start:g}: {expected}"


def needed_tool_text(tool: str, interfaces: Sequence[Interface]) -> str:
    """Say that an FMU cannot run without the tool that exported it."""
    need = "needs" if len(interfaces) == 1 else "need"
    return (
        f"{' and '.join(interfaces)} {need} the exporting tool to be installed on this machine"
        f"{f' ({tool})' if tool else ''}, as the FMU says with needsExecutionTool"
    )
