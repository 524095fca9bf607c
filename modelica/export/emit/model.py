"""A sorted model -> model.c and sizes.h, the generated part of the FMU's sources."""

from __future__ import annotations

from ..flat.evaluate import Evaluator
from ..flat.ir import Lit, Scalar, Time, Variable, names_in
from ..order.layout import System, discrete_outputs, kinds_of, literal
from ..order.parameters import calculated_starts, sorted_parameters
from ..order.sort import Block
from ..order.sparsity import depend_on_time, dependences, groups
from .blocks import Emitter
from .expressions import Printer, c_string
from .functions import functions_text

DELAY_POINTS = 4096
"""Number of points that a delay line can hold, unless the model specifies it."""

REPEAT_TICKS = {"never": 0, "unseen": 1, "always": 2}


_OPERATORS = {"<": "OP_LT", "<=": "OP_LE", ">": "OP_GT", ">=": "OP_GE"}


def model_c(system: System, evaluator: Evaluator) -> str:
    """Return the text of model.c, without the GUID, which depends on it."""
    model, layout = system.model, system.layout
    continuous, event, initial = (
        Emitter(system, "continuous"),
        Emitter(system, "event"),
        Emitter(system, "initial"),
    )
    lively, slopes = _lively(system), slope_blocks(system)
    rest = [block for block in lively if block not in slopes]
    crossing_names = {n for r in layout.relations for n in names_in(r)} | {
        n for f in layout.floors for n in names_in(f)
    }
    operands = [block for block in needed_for(crossing_names, lively) if block not in slopes]
    delayed = {v.name for line in layout.lines for v in (line.key, line.value)}
    into_lines = [block for block in needed_for(delayed, lively) if block not in slopes]
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
        *_line_functions(system, [line for b in into_lines for line in continuous.block(b)]),
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


def _lively(system: System) -> list[Block]:
    return [block for block in system.blocks if not block.discrete]


def slope_blocks(system: System) -> list[Block]:
    """Return the blocks that are needed at every point: for the derivatives, and for `pre` at an event."""
    before = system.before[len(system.discrete_reals) :]
    return needed_for({f"der({name})" for name in system.states} | set(before), _lively(system))


def needed_for(names: set[str], blocks: list[Block]) -> list[Block]:
    """Return the blocks on which some variables depend, in order."""
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


def _line_functions(system: System, inputs: list[str]) -> list[str]:
    printer = Printer(system.layout, "event")
    seeds, ends = [], []
    for k, line in enumerate(system.layout.lines):
        key = printer.text(line.key)
        for distance, value in line.seeds:
            seeds.append(f"line_seed(m, {k}, {key} - {printer.text(distance)}, {printer.text(value)});")
        entered, span = printer.text(line.value), printer.text(line.span)
        ends += [f"now->key[{k}] = {key};", f"now->value[{k}] = {entered};", f"now->span[{k}] = {span};"]
    return [
        _function("model_line_seeds", seeds),
        _function("model_lines", ["(void)now;", *inputs, *ends], "Model *m, Entries *now"),
    ]


def _implicit(system: System) -> list[str]:
    """Return the tables that the implicit method needs."""
    rows = dependences(system)
    depends = [str(int(j in row)) for row in rows for j in range(len(rows))]
    return [
        f"const int model_group[] = {{{', '.join(map(str, groups(rows))) or '0'}}};",
        f"const unsigned char model_depends[] = {{{', '.join(depends) or '0'}}};",
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
            array("int model_output_ints", [str(k) for k in discrete_outputs(system, system.ints)]),
            array("int model_output_reals", [str(k) for k in discrete_outputs(system, system.reals)]),
            array("unsigned char model_crossing_op", operators),
            array("double model_nominal", nominal),
            array("char *const model_line_names", [c_string(str(line.place)) for line in layout.lines]),
            *(_implicit(system) if system.implicit else ()),
        ]
    )


def sizes_h(system: System) -> str:
    """Return the text of sizes.h."""
    layout, solver = system.layout, system.model.solver
    fixed = solver.get("method", "adaptive") == "fixed"
    sizes = {
        "MODEL_STATES": len(system.states),
        "MODEL_REALS": len(system.reals),
        "MODEL_INTS": len(system.ints),
        "MODEL_PRE_REALS": len(system.before),
        "MODEL_DISCRETE_REALS": len(system.discrete_reals),
        "MODEL_OUTPUT_INTS": len(discrete_outputs(system, system.ints)),
        "MODEL_OUTPUT_REALS": len(discrete_outputs(system, system.reals)),
        "MODEL_CONDITIONS": system.model.conditions,
        "MODEL_RELATIONS": len(layout.relations),
        "MODEL_TIME_RELATIONS": len(layout.time_relations),
        "MODEL_FLOORS": len(layout.floors),
        "MODEL_TICKS": len(layout.ticks),
        "SOLVER_METHOD": '"implicit.h"' if system.implicit else '"explicit.h"',
        "SOLVER_STEP": repr(float(solver.get("step", system.model.interval or 0.01))) if fixed else "0.0",
        "SOLVER_TOLERANCE": repr(float(system.model.tolerance or 1e-6)),
        "SOLVER_MAX_STEP": repr(float(solver["maxStep"])) if "maxStep" in solver else "HUGE_VAL",
        "SOLVER_CHECKS": int(solver.get("checks", 1 if fixed else 4)),
        "SOLVER_REPEAT_TICKS": REPEAT_TICKS[str(solver.get("repeatTicks", "unseen"))],
        "MODEL_LINES": len(layout.lines),
        "LINE_POINTS": int(solver.get("delayPoints", DELAY_POINTS)) if layout.lines else 1,
    }
    if system.implicit:
        sizes["MODEL_GROUPS"] = max(groups(dependences(system)), default=-1) + 1
        sizes["MODEL_SLOPES_OF_TIME"] = int(depend_on_time(slope_blocks(system)))
    return "".join(f"#define {name} {value}\n" for name, value in sizes.items())
