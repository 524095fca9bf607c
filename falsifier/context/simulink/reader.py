"""From a file's sections to a diagram: blocks, lines, charts and settings."""

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from falsifier.context.simulink.diagram import Block, BlockSystem, Diagram, End, Wire
from falsifier.context.simulink.sections import ModelPackage, Node, parse_mdl, read_parts, text_parts
from falsifier.context.simulink.stateflow import read_charts
from falsifier.core.words import shortened
from falsifier.errors import SpecError

_MAX_TEXT_BYTES = 128 << 20
_SETTINGS = ("StartTime", "StopTime", "Solver", "SolverName", "FixedStep", "MaxStep", "SampleTime")
# Which parameters of a block carry meaning; the others say how it is drawn or generated.
_SATURATION = ("LimitOutput", "UpperSaturationLimit", "LowerSaturationLimit")
_NAMES = tomllib.loads(files(__package__).joinpath("names.toml").read_text(encoding="utf-8"))
_LISTED, _MEANINGFUL, _DRAWN = (frozenset(_NAMES[key].split()) for key in ("blocks", "meaningful", "drawn"))
_TYPES = ("DataTypeStr", "DataType", "DataTypeName", "ParamMin", "ParamMax")
# Values that say nothing: inherited sample times, no limits, off.
_EMPTY = frozenset(("", "[]", "-1", "off", "none"))
_KEPT_EVEN_IF_EMPTY = frozenset(
    ("Value", "Gain", "Threshold", "UpperLimit", "LowerLimit", "gainval", "Operator")
)
_LONGEST_VALUE = 2000


def read_diagram(path: Path) -> Diagram:
    """Read a ``.slx`` or ``.mdl`` file; libraries and referenced models are named, not followed.

    Raises:
        SpecError: if it cannot be read; names the part, or the line.
        ModelError: if a ``.slx`` file is not a zip archive, or a dangerous one.
    """
    try:
        return _diagram(_tree(path), str(path))
    except RecursionError:
        raise SpecError(f"{path}: its systems are nested too deep to be read") from None


def _diagram(tree: Node, shown: str) -> Diagram:
    top = tree.first("Model") or tree.first("Library") or tree.first("Subsystem")
    if top is None:
        kinds = ", ".join(dict.fromkeys(child.kind for child in tree.children)) or "nothing"
        raise SpecError(f"{shown}: expected a model or library, found {kinds}; is it a Simulink file?")
    root = top.first("System")
    if root is None:
        raise SpecError(f"{shown}: {top.kind} {top.get('Name')!r} has no system of blocks; save it again")
    defaults = (node for node in tree.walk() if node.kind == "BlockParameterDefaults")
    made = _Systems({b.get("BlockType"): b.values for each in defaults for b in each.all("Block")}, shown)
    return Diagram(
        name=top.get("Name") or root.get("Name") or Path(shown).stem,
        root=made.system(root),
        charts=tuple(read_charts(tree)),
        settings=tuple(_settings(tree, top)),
        is_library=top.kind == "Library",
    )


def _tree(path: Path) -> Node:
    if path.suffix.lower() == ".slx":
        return ModelPackage(read_parts(path), str(path)).tree()
    try:
        size = path.stat().st_size
        if size > _MAX_TEXT_BYTES:
            raise SpecError(
                f"{path}: has {size >> 20} MiB, more than {_MAX_TEXT_BYTES >> 20}; save the subsystem that "
                "matters as a model of its own"
            )
        # Old files are in the code page of the machine that wrote them; names in ASCII are read in any case.
        text = path.read_bytes().decode("utf-8", errors="replace")
    except OSError as error:
        raise SpecError(f"{path}: cannot be read ({error.strerror or error})") from None
    if "\0" in text:
        raise SpecError(f"{path}: expected text, found binary data; save the model as .mdl or .slx again")
    if parts := text_parts(text):
        return ModelPackage(parts, str(path)).tree()
    return parse_mdl(text, str(path))


def _settings(tree: Node, top: Node) -> Iterator[tuple[str, str]]:
    solver = next((n for n in tree.walk() if "SolverCC" in (n.kind + n.get("ClassName", "$ClassName"))), None)
    values = {**top.values, **(solver.values if solver else {})}
    for name in _SETTINGS:
        if values.get(name):
            yield name, values[name]


@dataclass(frozen=True, slots=True)
class _Systems:
    """Makes blocks and lines from sections."""

    defaults: Mapping[str, Mapping[str, str]]  # values of all blocks of a type, by type
    shown: str  # what errors call the file

    def system(self, node: Node, path: str = "") -> BlockSystem:
        nodes = [block for block in node.children if block.kind in ("Block", "Reference")]
        names = {block.get("SID"): _in_one_line(block.get("Name")) for block in nodes if block.get("SID")}
        blocks = tuple(self._block(block, path) for block in nodes)
        wires = tuple(_wires(node.all("Line"), names))
        known = {block.name for block in blocks}
        for end in (end for wire in wires for end in (wire.source, *wire.targets)):
            if end.block not in known:
                where = path or "the model"
                raise SpecError(
                    f"{self.shown}: a line of {where} ends at {shortened(end.block, 60)!r}, which is no "
                    "block there; save the model again"
                )
        return BlockSystem(blocks, wires)

    def _block(self, node: Node, path: str) -> Block:
        kind = node.get("BlockType") or ("Reference" if node.kind == "Reference" else "")
        name = _in_one_line(node.get("Name"))
        if not kind or not node.get("Name"):
            missing = "type" if not kind else "name"
            raise SpecError(
                f"{self.shown}: a block of {path or 'the model'} has no {missing} ({name or kind}); "
                "save it again"
            )
        instance = node.first("InstanceData")
        stated = {**node.values, **(instance.values if instance else {})}
        below = node.first("System")
        # In older files, charts are masked subsystems around an S-function.
        is_old = "Stateflow" in node.get("MaskType") or node.get("ErrorFcn").startswith("Stateflow")
        is_chart = is_old or node.get("SFBlockType") not in ("", "NONE")
        return Block(
            type=kind,
            name=name,
            parameters=_meaningful(kind, stated, self.defaults.get(kind, {})),
            reference=_in_one_line(
                node.get("SourceBlock", "ModelNameDialog", "ModelFile", "ModelName", "ReferencedSubsystem")
            ),
            number=_number(node.get("Port")) if kind in ("Inport", "Outport") else 0,
            system=None if below is None or is_chart else self.system(below, f"{path}/{name}".lstrip("/")),
            is_chart=is_chart,
            inputs=_inputs(below) if is_chart else (),
            is_off=node.get("Commented") == "on",
        )


def _meaningful(
    kind: str, stated: Mapping[str, str], defaults: Mapping[str, str]
) -> tuple[tuple[str, str], ...]:
    """Return the parameters of a block that carry meaning, as pairs of name and value.

    The ``defaults`` are what the file states of all blocks of this type.
    """
    if kind in _LISTED:
        everything = {**stated, **defaults, **stated}  # what is stated comes first, and counts
        found = {name: value for name, value in everything.items() if name in _MEANINGFUL}
    else:
        found = {name: value for name, value in stated.items() if not _is_drawn(name, value)}
    if (found.get("LimitOutput") or "off") == "off":
        found = {name: value for name, value in found.items() if name not in _SATURATION}
    sample = stated.get("SampleTime", "")
    if kind not in ("Constant", "SubSystem") or sample not in ("inf", "-1"):
        found["SampleTime"] = sample
    return tuple(
        (name, shortened(_in_one_line(value), _LONGEST_VALUE))
        for name, value in found.items()
        if value.strip() not in _EMPTY or (name in _KEPT_EVEN_IF_EMPTY and value.strip())
    )


def _is_drawn(name: str, value: str) -> bool:
    """Whether a parameter says how a block is drawn or which types it has; library blocks state dozens."""
    return name in _DRAWN or name.startswith("Mask") or name.endswith(_TYPES) or value.startswith("Inherit")


def _inputs(below: Node | None) -> tuple[str, ...]:
    """Names of the inputs of a chart, in the order of their ports."""
    inside = below.all("Block") if below is not None else ()
    ports = [block for block in inside if block.get("BlockType") == "Inport"]
    return tuple(_in_one_line(p.get("Name")) for p in sorted(ports, key=lambda p: _number(p.get("Port"))))


def _wires(lines: Iterable[Node], names: Mapping[str, str]) -> Iterator[Wire]:
    """The lines that begin at a block; others carry nothing."""
    for line in lines:
        if (source := _end(line, "Src", names)) is not None:
            yield Wire(source, tuple(_targets(line, names)), _in_one_line(line.get("Name")))


def _targets(line: Node, names: Mapping[str, str]) -> Iterator[End]:
    target = _end(line, "Dst", names)
    if target is not None:
        yield target
    for branch in line.all("Branch"):
        yield from _targets(branch, names)


def _end(line: Node, side: str, names: Mapping[str, str]) -> End | None:
    """One end of a line: ``SID#out:1`` in newer files, a name and a port in older ones."""
    sid, sign, port = line.get(side).partition("#")  # 5#out:1, 7#in:2, 7#enable
    if sid and sign:
        return End(names.get(sid, f"SID {sid}"), port.partition(":")[2] or port)
    block = line.get(f"{side}Block")
    return End(_in_one_line(block), line.get(f"{side}Port") or "1") if block else None


def _in_one_line(name: str) -> str:
    """Return a name without the line breaks with which it is drawn."""
    return " ".join(name.split())


def _number(text: str) -> int:
    return int(text) if text.isdecimal() else 1
