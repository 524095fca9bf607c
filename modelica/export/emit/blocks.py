"""Equations and statements -> C statements."""

from __future__ import annotations

from collections.abc import Iterable

from ..flat.ir import Assert, Branch, Condition, DelayLine, Outputs, Reinit, Section, Set, Statement
from ..order.contents import Solved
from ..order.layout import System, c_type
from ..order.sort import Block
from ..read.syntax import ExportError
from .expressions import Mode, Printer, c_name, c_string


class Emitter:
    """Prints blocks for one mode."""

    def __init__(self, system: System, mode: Mode) -> None:
        self.system = system
        self.printer = Printer(system.layout, mode)
        self.mode = mode

    def block(self, block: Block) -> list[str]:
        """Print one block."""
        item = block.item
        match item:
            case Solved(target, value, _, _):
                return [f"{self.system.layout.slots[target]} = {self.printer.text(value)};"]
            case Section(statements, _):
                return [line for name in block.defines for line in self.entry(name)] + self.statements(
                    statements
                )
            case DelayLine(position=position, out=out):
                line = self.system.layout.lines.index(item)
                slot = self.system.layout.slots[out.name]
                return [f"{slot} = line_read(m, {line}, {self.printer.text(position)});"]
            case Assert():
                return self.statement(item) if self.mode != "initial" else []
            case _:
                return self.statement(item)

    def entry(self, name: str) -> list[str]:
        """Assign to a variable its value at the start of an algorithm section."""
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
        """Print statements in their order."""
        return [line for item in items for line in self.statement(item)]

    def statement(self, item: Statement) -> list[str]:
        """Print one statement."""
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
                    raise ExportError(place, f"'{state}' in reinit is not a state")
                k = self.system.states.index(state)
                jump = f"m->reinit_value[{k}] = {text(value)}; m->reinit_set[{k}] = 1;"
                return [f"if ({text(condition)}) {{ {jump} }}"]
            case Assert(condition, message, place):
                return [f"if (!{text(condition)}) model_fail(m, {c_string(f'{place}: {message}')});"]

    def outputs(self, item: Outputs) -> list[str]:
        """Print a call of a function with array results or several outputs."""
        layout = self.system.layout
        args = [text for arg in item.args for text in self.printer.argument(arg)]
        before: list[str] = []
        after: list[str] = []
        pointers = []
        components = [
            c for c in self.system.model.functions[item.function].components if c.causality == "output"
        ]
        for k, (target, component) in enumerate(zip(item.targets, components, strict=True)):
            ctype = c_type(component.type_name)
            if target is None:
                if component.dimensions:
                    raise ExportError(item.place, "an array output cannot be omitted")
                before.append(f"{ctype} unused_{k};")
                pointers.append(f"&unused_{k}")
                continue
            places = [layout.offsets[name] for name in target]
            size = [str(len(target))] * bool(component.dimensions)
            if places and all(p == (places[0][0], places[0][1] + j) for j, p in enumerate(places)):
                pointers += [f"&{layout.slots[target[0]]}", *size]
                continue
            before.append(f"{ctype} result_{k}[{max(len(target), 1)}];")
            pointers += [f"result_{k}", *size]
            after += [f"{layout.slots[name]} = result_{k}[{j}];" for j, name in enumerate(target)]
        if len(components) == 1 and not components[0].dimensions:
            target = item.targets[0]
            call = f"{c_name(item.function)}({', '.join(['m', *args])})"
            return [f"{layout.slots[target[0]]} = {call};" if target else f"(void){call};"]
        call = f"{c_name(item.function)}({', '.join(['m', *args, *pointers])});"
        return ["{", *("    " + line for line in [*before, call, *after]), "}"]
