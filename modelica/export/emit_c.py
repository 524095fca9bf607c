"""A sorted model -> model.c and sizes.h, the generated half of the FMU's sources."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from .evaluate import Evaluator
from .functions_c import c_string, functions_text
from .ir import (
    Assert,
    Branch,
    Condition,
    FlatModel,
    Floor,
    Lit,
    Outputs,
    Pre,
    Reinit,
    Relation,
    Scalar,
    Section,
    Set,
    Statement,
    Tick,
    Time,
    Var,
    Variable,
    names_in,
    walk,
)
from .parameters import calculated_starts, fixed_names, sorted_parameters
from .print_c import C_TYPES, Layout, Mode, Printer, c_name, literal
from .sort import Block, Solved, values, when_targets
from .syntax import ExportError

REPEAT_TICKS = {"never": 0, "unseen": 1, "always": 2}
_OPERATORS = {"<": "OP_LT", "<=": "OP_LE", ">": "OP_GT", ">=": "OP_GE"}


@dataclass(slots=True)
class System:
    """Everything about a model that the printers need.

    Attributes:
        reals: names of all Reals in the order of their value references; states and derivatives first.
        ints: names of all Integers and Booleans in that order.
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
    def crossings(self) -> int:
        """The number of event indicators."""
        return len(self.layout.relations) + 2 * len(self.layout.floors)


def lay_out(model: FlatModel, states: list[str], blocks: list[Block], initial_blocks: list[Block]) -> System:
    """Give every variable, relation and sample its place."""
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
    discrete = {n for block in blocks if block.discrete and _in_when(block) for n in block.defines}
    needed = {
        part.name for block in blocks for v in values(block.item) for part in walk(v) if isinstance(part, Pre)
    }
    discrete |= _section_memory(blocks, model)
    system.discrete_reals = [n for n in system.reals if n in discrete]
    _check_pre(system)
    extra = [n for n in system.reals if n in needed and n not in set(system.discrete_reals)]
    system.before = system.discrete_reals + extra
    for k, name in enumerate(system.before):
        layout.before[name] = f"m->pr[{k}]"
    _events(system)
    return system


def _in_when(block: Block) -> bool:
    return isinstance(block.item, Section) or (isinstance(block.item, Solved) and block.item.discrete)


def _section_memory(blocks: list[Block], model: FlatModel) -> set[str]:
    """Variables of algorithm sections that keep their value between events: declared so, or set in a when clause."""
    found: set[str] = set()
    for block in blocks:
        if isinstance(block.item, Section):
            found |= {n for n in block.defines if n in model.variables and model.variables[n].variability == "discrete"}
            found |= {n for statement in block.item.statements for n in when_targets(statement)}
    return found


def _check_pre(system: System) -> None:
    """`pre` of a continuous variable is only defined at events."""
    known = set(system.discrete_reals)
    for block in system.blocks:
        if _in_when(block) or not isinstance(block.item, (Solved, Condition, Outputs)):
            continue
        for part in (part for value in values(block.item) for part in walk(value)):
            if isinstance(part, Pre) and part.type == "Real" and part.name not in known:
                place = block.item.place
                raise ExportError(place, f"'pre({part.name})' of a continuous variable can only stand in a when clause")


def _events(system: System) -> None:
    layout = system.layout
    varying = _varying(system)
    for block in system.blocks:
        for value in values(block.item):
            for part in walk(value):
                if isinstance(part, Tick):
                    layout.ticks.setdefault((part.start, part.interval), len(layout.ticks))
                elif isinstance(part, Floor) and _changes(part.arg, varying):
                    layout.floors.setdefault(part.arg, len(layout.floors))
                elif isinstance(part, Relation):
                    _relation(part, layout, varying, system.model)


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


# ------------------------------------------------------------------- statements


class Emitter:
    """Prints blocks for one mode."""

    def __init__(self, system: System, mode: Mode) -> None:
        self.system = system
        self.printer = Printer(system.layout, mode)
        self.mode = mode

    def block(self, block: Block) -> list[str]:
        """One block."""
        item = block.item
        match item:
            case Solved(target, value, _, _):
                return [f"{self.system.layout.slots[target]} = {self.printer.text(value)};"]
            case Section(statements, _):
                return [line for name in block.defines for line in self.entry(name)] + self.statements(
                    statements
                )
            case Assert():
                return self.statement(item) if self.mode != "initial" else []
            case _:
                return self.statement(item)

    def entry(self, name: str) -> list[str]:
        """The value that a variable has where an algorithm section begins."""
        if name.startswith("when("):
            return []
        variable = self.system.model.variables[name]
        slot = self.system.layout.slots[name]
        if name in self.system.layout.before and (
            variable.type != "Real" or name in self.system.discrete_reals
        ):
            return [f"{slot} = {self.system.layout.before[name]};"]
        return [f"{slot} = {self.printer.text(variable.start) if variable.start else '0'};"]

    def statements(self, items: Iterable[Statement]) -> list[str]:
        """Statements in their order."""
        return [line for item in items for line in self.statement(item)]

    def statement(self, item: Statement) -> list[str]:
        """One statement."""
        text, slots = self.printer.text, self.system.layout.slots
        match item:
            case Set(name, value, _):
                return [f"{slots[name]} = {text(value)};"]
            case Condition(index, value, _):
                return (
                    []
                    if self.mode == "continuous"
                    else [f"m->w[{index - 1}] = (unsigned char){text(value)};"]
                )
            case Branch(branches, otherwise, _):
                lines = []
                for k, (condition, body) in enumerate(branches):
                    lines += [f"{'if' if k == 0 else '} else if'} ({text(condition)}) {{"]
                    lines += ["    " + line for line in self.statements(body)]
                if otherwise:
                    lines += ["} else {", *("    " + line for line in self.statements(otherwise))]
                return [*lines, "}"]
            case Outputs():
                return self.outputs(item)
            case Reinit(state, condition, value, place):
                if self.mode != "event":
                    return []
                if state not in self.system.states:
                    raise ExportError(place, f"reinit: '{state}' is not a state")
                k = self.system.states.index(state)
                return [
                    f"if ({text(condition)}) {{ m->reinit_value[{k}] = {text(value)}; m->reinit_set[{k}] = 1; }}"
                ]
            case Assert(condition, message, place):
                return [f"if (!{text(condition)}) model_fail(m, {c_string(f'{place}: {message}')});"]

    def outputs(self, item: Outputs) -> list[str]:
        """A call of a function with array results or several outputs."""
        layout = self.system.layout
        args = [text for arg in item.args for text in self.printer.argument(arg)]
        before: list[str] = []
        after: list[str] = []
        pointers = []
        components = [
            c for c in self.system.model.functions[item.function].components if c.causality == "output"
        ]
        for k, (target, component) in enumerate(zip(item.targets, components, strict=True)):
            ctype = C_TYPES[component.type_name]  # type: ignore[index]
            if target is None:
                if component.dimensions:
                    raise ExportError(item.place, "an array output cannot be left out")
                before.append(f"{ctype} unused_{k};")
                pointers.append(f"&unused_{k}")
                continue
            places = [layout.offsets[name] for name in target]
            if places and all(p == (places[0][0], places[0][1] + j) for j, p in enumerate(places)):
                pointers.append(f"&{layout.slots[target[0]]}")
                continue
            before.append(f"{ctype} result_{k}[{max(len(target), 1)}];")
            pointers.append(f"result_{k}")
            after += [f"{layout.slots[name]} = result_{k}[{j}];" for j, name in enumerate(target)]
        if len(components) == 1 and not components[0].dimensions:
            target = item.targets[0]
            call = f"{c_name(item.function)}({', '.join(['m', *args])})"
            return [f"{layout.slots[target[0]]} = {call};" if target else f"(void){call};"]
        call = f"{c_name(item.function)}({', '.join(['m', *args, *pointers])});"
        return ["{", *("    " + line for line in [*before, call, *after]), "}"]


# ------------------------------------------------------------------- the file


def model_c(system: System, evaluator: Evaluator) -> str:
    """The text of model.c (without the GUID, which depends on it)."""
    model, layout = system.model, system.layout
    continuous, event, initial = (Emitter(system, mode) for mode in ("continuous", "event", "initial"))  # type: ignore[arg-type]
    lively = [block for block in system.blocks if not block.discrete]
    slopes = needed_for({f"der({name})" for name in system.states}, lively)
    rest = [block for block in lively if block not in slopes]
    crossing_names = {n for r in layout.relations for n in names_in(r)} | {
        n for f in layout.floors for n in names_in(f)
    }
    operands = [block for block in needed_for(crossing_names, lively) if block not in slopes]
    parts = [
        _function("model_defaults", _defaults(system)),
        _function("model_parameters", _parameters(system)),
        _function("model_starts", _starts(system)),
        _function("model_initial", [line for b in system.initial_blocks for line in initial.block(b)]),
        _function("model_event", [line for b in system.blocks for line in event.block(b)]),
        _function("model_derivatives", [line for b in slopes for line in continuous.block(b)]),
        _function("model_rest", [line for b in rest for line in continuous.block(b)]),
        _function("model_operands", [line for b in operands for line in continuous.block(b)]),
        *_crossing_functions(system),
    ]
    functions = functions_text(model, evaluator, layout)
    body = "\n\n".join(parts)
    return (
        "\n\n".join(
            [
                f'/* Generated from the Modelica model {model.name}. */\n#include "model.h"',
                _tables(system),
                layout.table_text(),
                functions,
                body,
            ]
        )
        + "\n"
    )


def needed_for(names: set[str], blocks: list[Block]) -> list[Block]:
    """The blocks that some variables depend on, in order."""
    wanted = set(names)
    chosen = []
    for block in reversed(blocks):
        if wanted & set(block.defines):
            chosen.append(block)
            wanted |= block.uses
    return chosen[::-1]


def _function(name: str, lines: list[str], arguments: str = "Model *m") -> str:
    body = "".join(f"    {line}\n" for line in lines)
    return f"void {name}({arguments}) {{\n    (void)m;\n{body}}}"


def _defaults(system: System) -> list[str]:
    lines = []
    for name, variable in system.model.variables.items():
        value = variable.binding if variable.variability == "parameter" else variable.start
        if isinstance(value, Lit) and value.value != 0:
            lines.append(f"{system.layout.slots[name]} = {literal(value.value, variable.type)};")
    return lines


def _parameters(system: System) -> list[str]:
    printer = Printer(system.layout, "event")
    return [
        f"{system.layout.slots[v.name]} = {printer.text(_known(v))};" for v in sorted_parameters(system.model)
    ]


def _starts(system: System) -> list[str]:
    printer = Printer(system.layout, "event")
    found = calculated_starts(system.model)
    return [f"{system.layout.slots[v.name]} = {printer.text(v.start)};" for v in found if v.start is not None]


def _known(variable: Variable) -> Scalar:
    assert variable.binding is not None
    return variable.binding


def _crossing_functions(system: System) -> list[str]:
    layout = system.layout
    printer = Printer(layout, "continuous")
    count = len(layout.relations)
    crossings, floors, thresholds, ticks = [], [], [], []
    for relation, k in layout.relations.items():
        crossings.append(f"z[{k}] = {printer.text(relation.left)} - {printer.text(relation.right)};")
    for arg, k in layout.floors.items():
        text = printer.text(arg)
        crossings += [
            f"z[{count + 2 * k}] = {text} - m->fl[{k}];",
            f"z[{count + 2 * k + 1}] = {text} - m->fl[{k}] - 1;",
        ]
        floors.append(f"values[{k}] = floor({text});")
    for relation, k in layout.time_relations.items():
        other = relation.right if isinstance(relation.left, Time) else relation.left
        thresholds.append(f"at[{k}] = {printer.text(other)};")
    for (start, interval), k in layout.ticks.items():
        ticks.append(
            f"if (k == {k}) {{ *start = {printer.text(start)}; *interval = {printer.text(interval)}; }}"
        )
    return [
        _function("model_crossings", ["(void)z;", *crossings], "Model *m, double *z"),
        _function("model_floors", ["(void)values;", *floors], "Model *m, double *values"),
        _function("model_thresholds", ["(void)at;", *thresholds], "Model *m, double *at"),
        _function(
            "model_tick_times",
            ["(void)k;", "*start = 0;", "*interval = 1;", *ticks],
            "Model *m, int k, double *start, double *interval",
        ),
    ]


def _tables(system: System) -> str:
    layout, model = system.layout, system.model
    kinds = kinds_of(system)
    real_kinds = [kinds.get(name, "KIND_LOCAL") for name in system.reals]
    int_kinds = [kinds.get(name, "KIND_LOCAL") for name in system.ints]
    before = [str(system.reals.index(name)) for name in system.before]
    operators = [_OPERATORS[relation.name] for relation in layout.relations] + ["OP_GE", "OP_LT"] * len(
        layout.floors
    )
    nominal = [literal(model.variables[name].nominal or 1.0, "Real") for name in system.states]

    def array(head: str, items: list[str]) -> str:
        return f"const {head}[] = {{{', '.join(items) or '0'}}};"

    return "\n".join(
        [
            array("unsigned char model_real_kind", real_kinds),
            array("unsigned char model_int_kind", int_kinds),
            array("int model_pre_reals", before),
            array("int model_output_ints", [str(k) for k in _discrete_outputs(system, system.ints)]),
            array("int model_output_reals", [str(k) for k in _discrete_outputs(system, system.reals)]),
            array("unsigned char model_crossing_op", operators),
            array("double model_nominal", nominal),
        ]
    )


def _discrete_outputs(system: System, names: list[str]) -> list[int]:
    """Places of the outputs that change at events only."""
    discrete = set(system.discrete_reals) | set(system.ints)
    outputs = {name for name, variable in system.model.variables.items() if variable.causality == "output"}
    return [k for k, name in enumerate(names) if name in discrete & outputs]


def kinds_of(system: System) -> dict[str, str]:
    """How each variable may be set from outside."""
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


def sizes_h(system: System) -> str:
    """The text of sizes.h."""
    layout, solver = system.layout, system.model.solver
    fixed = solver.get("method", "adaptive") == "fixed"
    sizes = {
        "MODEL_STATES": len(system.states),
        "MODEL_REALS": len(system.reals),
        "MODEL_INTS": len(system.ints),
        "MODEL_PRE_REALS": len(system.before),
        "MODEL_DISCRETE_REALS": len(system.discrete_reals),
        "MODEL_OUTPUT_INTS": len(_discrete_outputs(system, system.ints)),
        "MODEL_OUTPUT_REALS": len(_discrete_outputs(system, system.reals)),
        "MODEL_CONDITIONS": system.model.conditions,
        "MODEL_RELATIONS": len(layout.relations),
        "MODEL_TIME_RELATIONS": len(layout.time_relations),
        "MODEL_FLOORS": len(layout.floors),
        "MODEL_TICKS": len(layout.ticks),
        "SOLVER_STEP": repr(float(solver.get("step", system.model.interval or 0.01))) if fixed else "0.0",
        "SOLVER_TOLERANCE": repr(float(system.model.tolerance or 1e-6)),
        "SOLVER_MAX_STEP": repr(float(solver["maxStep"])) if "maxStep" in solver else "HUGE_VAL",
        "SOLVER_CHECKS": int(solver.get("checks", 1 if fixed else 4)),
        "SOLVER_REPEAT_TICKS": REPEAT_TICKS[str(solver.get("repeatTicks", "unseen"))],
    }
    return "".join(f"#define {name} {value}\n" for name, value in sizes.items())
