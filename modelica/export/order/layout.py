"""The memory layout of the C model: places of all variables, relations and samples."""

from __future__ import annotations

from dataclasses import dataclass, field

from ..flat.ir import (
    Branch,
    Condition,
    DelayLine,
    FlatModel,
    Floor,
    Lit,
    Outputs,
    Pre,
    Relation,
    Scalar,
    Section,
    Statement,
    Tick,
    Time,
    Type,
    Var,
    names_in,
    walk,
)
from ..read.syntax import ExportError
from .contents import Solved, targets, values, when_targets
from .parameters import fixed_names
from .sort import Block


def c_type(kind: Type) -> str:
    """Return the C type of a value."""
    return "double" if kind == "Real" else "int"


def literal(value: float, kind: Type) -> str:
    """A C literal."""
    if kind == "Real":
        text = repr(float(value))
        return text if value >= 0 else f"({text})"
    return str(int(value)) if value >= 0 else f"({int(value)})"


@dataclass(slots=True)
class Layout:
    """Places of everything in the C model; filled once, then read by the printers."""

    slots: dict[str, str] = field(default_factory=dict)  # variable or der(x) -> C lvalue
    offsets: dict[str, tuple[str, int]] = field(default_factory=dict)  # variable -> (array, index)
    before: dict[str, str] = field(default_factory=dict)  # variable -> C lvalue of its value before the event
    relations: dict[Relation, int] = field(default_factory=dict)  # with a zero crossing
    time_relations: dict[Relation, int] = field(default_factory=dict)
    floors: dict[Scalar, int] = field(default_factory=dict)
    ticks: dict[tuple[Scalar, Scalar], int] = field(default_factory=dict)
    lines: list[DelayLine] = field(default_factory=list)
    tables: dict[tuple[str, ...], str] = field(default_factory=dict)  # constant arrays

    def table(self, texts: tuple[str, ...], kind: Type) -> str:
        """Return the name of a constant array with these elements."""
        key = (c_type(kind), *texts)
        return self.tables.setdefault(key, f"table_{len(self.tables) + 1}")

    def table_text(self) -> str:
        """Return the definitions of all constant arrays."""
        lines = []
        for (ctype, *texts), name in self.tables.items():
            lines.append(
                f"static const {ctype} {name}[{max(len(texts), 1)}] = {{{', '.join(texts) or '0'}}};"
            )
        return "\n".join(lines)


@dataclass(slots=True)
class System:
    """Everything that the printers need to know about a model.

    Attributes:
        reals: names of all Reals in the order of their value references; states and derivatives first.
        ints: names of all Integers and Booleans in the order of their value references.
    """

    model: FlatModel
    states: list[str]
    blocks: list[Block]
    initial_blocks: list[Block]
    reals: list[str] = field(default_factory=list)
    ints: list[str] = field(default_factory=list)
    discrete_reals: list[str] = field(default_factory=list)
    before: list[str] = field(default_factory=list)
    layout: Layout = field(default_factory=Layout)

    @property
    def implicit(self) -> bool:
        """Whether the model is integrated by the implicit method."""
        return self.model.solver.get("method") == "implicit"

    @property
    def crossings(self) -> int:
        """The number of event indicators."""
        return len(self.layout.relations) + 2 * len(self.layout.floors)


def lay_out(model: FlatModel, states: list[str], blocks: list[Block], initial_blocks: list[Block]) -> System:
    """Assign a place to every variable, relation and sample."""
    system = System(model, states, blocks, initial_blocks)
    known_states = set(states)
    others = [n for n, v in model.variables.items() if v.type == "Real" and n not in known_states]
    system.reals = [*states, *(f"der({name})" for name in states), *others]
    system.ints = [name for name, v in model.variables.items() if v.type != "Real"]
    layout = system.layout
    for k, name in enumerate(system.reals):
        layout.slots[name], layout.offsets[name] = f"m->r[{k}]", ("m->r", k)
    for k, name in enumerate(system.ints):
        layout.slots[name], layout.offsets[name] = f"m->i[{k}]", ("m->i", k)
        layout.before[name] = f"m->pi[{k}]"
    discrete = {n for block in blocks if block.discrete and in_when(block) for n in block.defines}
    needed = {
        part.name for block in blocks for v in values(block.item) for part in walk(v) if isinstance(part, Pre)
    }
    discrete |= _section_memory(blocks, model)
    system.discrete_reals = [n for n in system.reals if n in discrete]
    for name, variable in model.variables.items():
        wanted = variable.variability == "discrete" and variable.causality != "input"
        if variable.type == "Real" and wanted and name not in discrete:
            raise ExportError(variable.place, f"the discrete variable '{name}' is not set in a when clause")
    _check_pre(system)
    extra = [n for n in system.reals if n in needed and n not in set(system.discrete_reals)]
    system.before = system.discrete_reals + extra
    for k, name in enumerate(system.before):
        layout.before[name] = f"m->pr[{k}]"
    _events(system)
    return system


def in_when(block: Block) -> bool:
    """Whether a block comes from a when clause or may contain one."""
    return isinstance(block.item, Section) or (isinstance(block.item, Solved) and block.item.discrete)


def _section_memory(blocks: list[Block], model: FlatModel) -> set[str]:
    """Return the variables of algorithm sections that keep their value between events."""
    found: set[str] = set()
    for block in blocks:
        if isinstance(block.item, Section):
            found |= {
                n
                for n in block.defines
                if n in model.variables and model.variables[n].variability == "discrete"
            }
            found |= {n for statement in block.item.statements for n in when_targets(statement)}
    return found


def _check_pre(system: System) -> None:
    """Reject `pre` of a continuous variable outside when clauses: it is only defined at events."""
    known = set(system.discrete_reals)
    for block in system.blocks:
        if in_when(block) or not isinstance(block.item, (Solved, Condition, Outputs)):
            continue
        for part in (part for value in values(block.item) for part in walk(value)):
            if isinstance(part, Pre) and part.type == "Real" and part.name not in known:
                place = block.item.place
                raise ExportError(
                    place, f"'pre({part.name})' of a continuous variable is only allowed in a when clause"
                )


def _events(system: System) -> None:
    layout = system.layout
    varying = _varying(system)
    for block in system.blocks:
        if isinstance(block.item, DelayLine):
            layout.lines.append(block.item)
        for value in values(block.item):
            for part in walk(value):
                if isinstance(part, Tick):
                    layout.ticks.setdefault((part.start, part.interval), len(layout.ticks))
                elif isinstance(part, Floor) and _changes(part.arg, varying):
                    layout.floors.setdefault(part.arg, len(layout.floors))
                elif isinstance(part, Relation):
                    _relation(part, layout, varying, system.model)
    for block in system.blocks:
        if isinstance(block.item, Section):
            _refuse_set_again(block.item.statements, layout, set())


def _refuse_set_again(statements: tuple[Statement, ...], layout: Layout, compared: set[str]) -> None:
    """Reject setting a variable again after a relation of it: events are found by the last value."""
    frozen = {*layout.relations, *layout.time_relations, *(Floor(arg) for arg in layout.floors)}
    for item in statements:
        own = [condition for condition, _ in item.branches] if isinstance(item, Branch) else values(item)
        compared |= {n for value in own for part in walk(value) if part in frozen for n in names_in(part)}
        if isinstance(item, Branch):
            bodies = [*(body for _, body in item.branches), item.otherwise]
            after = [set(compared) for _ in bodies]
            for body, found in zip(bodies, after, strict=True):
                _refuse_set_again(body, layout, found)
            compared |= set().union(*after)
        elif again := sorted(compared & set(targets(item))):
            raise ExportError(
                item.place,
                f"'{again[0]}' is set again after the algorithm has compared it, so that its event "
                "cannot be found; use another variable, or noEvent(...)",
            )


def _relation(part: Relation, layout: Layout, varying: set[str], model: FlatModel) -> None:
    sides = (part.left, part.right)
    if any(isinstance(side, Time) for side in sides) and not all(_changes(side, varying) for side in sides):
        layout.time_relations.setdefault(part, len(layout.time_relations))
    elif any(_changes(side, varying) for side in sides):
        layout.relations.setdefault(part, len(layout.relations))


def _varying(system: System) -> set[str]:
    inputs = {n for n, v in system.model.variables.items() if v.causality == "input" and v.type == "Real"}
    return set(system.states) | inputs | {n for b in system.blocks if not b.discrete for n in b.defines}


def _changes(node: Scalar, varying: set[str]) -> bool:
    return bool(names_in(node) & varying) or any(isinstance(part, Time) for part in walk(node))


def discrete_outputs(system: System, names: list[str]) -> list[int]:
    """Return the places of the outputs that change only at events."""
    discrete = set(system.discrete_reals) | set(system.ints)
    outputs = {name for name, variable in system.model.variables.items() if variable.causality == "output"}
    return [k for k, name in enumerate(names) if name in discrete & outputs]


def kinds_of(system: System) -> dict[str, str]:
    """Return how each variable may be set through the FMI."""
    model = system.model
    fixed = fixed_names(model)
    initial = {e.left.name for e in model.initial_equations if isinstance(e.left, Var)}
    started = set(system.states) | set(system.discrete_reals) | set(system.ints)
    kinds = {}
    for name, variable in model.variables.items():
        if variable.causality == "input":
            kinds[name] = "KIND_INPUT"
        elif variable.variability == "parameter":
            if isinstance(variable.binding, Lit) and not variable.final and name not in model.structural:
                kinds[name] = "KIND_FIXED" if name in fixed else "KIND_TUNABLE"
        elif (
            name in started
            and name not in initial
            and (variable.start is None or isinstance(variable.start, Lit))
        ):
            kinds[name] = "KIND_START"
    return kinds
