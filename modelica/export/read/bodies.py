"""Parse tree of equations, statements and expressions -> syntax tree."""

from __future__ import annotations

import sys
from typing import Any

from .syntax import (
    LARGEST_INTEGER,
    ArrayOf,
    Assign,
    Body,
    Call,
    Choice,
    Colon,
    End,
    Equal,
    ExportError,
    Expr,
    For,
    If,
    Item,
    Jump,
    Number,
    Operation,
    Part,
    Place,
    Range,
    Ref,
    Run,
    Several,
    Text,
    Truth,
    When,
    While,
)

_ESCAPES = {"n": "\n", "t": "\t", "r": "\r"}


def _one(node: Any) -> Any:
    """Return the first element of a list, or the argument itself if it is not a list."""
    return node[0] if isinstance(node, list) else node


class BodyReader:
    """Reads equations, statements and expressions."""

    def __init__(self, file: str) -> None:
        self.file = file

    def place(self, ctx: Any) -> Place:
        """Return the place at which a node of the parse tree starts."""
        token = getattr(ctx, "start", None) or ctx.symbol
        return Place(self.file, token.line)

    def strings(self, ctx: Any) -> str:
        """Read a description: string literals joined by +."""
        return "".join(self.string(node.getText()) for node in ctx.STRING()) if ctx else ""

    @staticmethod
    def string(literal: str) -> str:
        """Return the text of a string literal, with each run of white space replaced by one space."""
        out, marks = [], iter(literal[1:-1])
        for mark in marks:
            if mark == "\\":
                following = next(marks, "\\")
                out.append(_ESCAPES.get(following, following))
            else:
                out.append(mark)
        return " ".join("".join(out).split())

    # ------------------------------------------------------------- equations

    def equations(self, ctx: Any) -> Body:
        """A block of equations."""
        return tuple(self.equation(node.equation_options()) for node in ctx.equation())

    def equation(self, ctx: Any) -> Item:
        """One equation."""
        place, form = self.place(ctx), type(ctx).__name__
        if form == "Equation_simpleContext":
            right = self.expression(ctx.expression())
            several = self.output_list(ctx.simple_expression())
            if several is not None:
                return Several(several, right, place)
            return Equal(self.simple(ctx.simple_expression()), right, place)
        if form == "Equation_ifContext":
            return self.conditional(ctx.if_equation(), self.equations, place)
        if form == "Equation_forContext":
            return self.loop(ctx.for_equation(), self.equations, place)
        if form == "Equation_whenContext":
            node = ctx.when_equation()
            pairs = zip(node.conditions, node.blocks, strict=True)
            return When(tuple((self.expression(c), self.equations(b)) for c, b in pairs), place)
        if form == "Equation_functionContext":
            return Run(self.call(ctx.name().getText(), ctx.function_call_args(), place), place)
        raise ExportError(place, "connect equations are not supported")

    def output_list(self, ctx: Any) -> tuple[Ref | None, ...] | None:
        """Read the references of `(a, , b)`; return None for any other node."""
        node = ctx
        while node.getChildCount() == 1:
            node = node.getChild(0)
        if type(node).__name__ != "Primary_output_expression_listContext":
            return None
        items = self.slots(node.output_expression_list())
        return items if len(items) > 1 else None

    def slots(self, ctx: Any) -> tuple[Ref | None, ...]:
        """Read references separated by commas; an empty slot is None."""
        slots: list[Ref | None] = [None]
        for child in ctx.children or ():
            if child.getText() == ",":
                slots.append(None)
                continue
            item = self.expression(child)
            if not isinstance(item, Ref):
                raise ExportError(self.place(child), "only variables can receive the outputs of a function")
            slots[-1] = item
        return tuple(slots)

    # ------------------------------------------------------------ statements

    def statements(self, ctx: Any) -> Body:
        """A block of statements."""
        return tuple(self.statement(node.statement_options()) for node in ctx.statement())

    def statement(self, ctx: Any) -> Item:
        """One statement."""
        place, form = self.place(ctx), type(ctx).__name__
        match form:
            case "Statement_component_referenceContext":
                target = self.ref(ctx.component_reference())
                if ctx.expression():
                    return Assign(target, self.expression(ctx.expression()), place)
                return Run(self.call(str(target), ctx.function_call_args(), place), place)
            case "Statement_component_functionContext":
                name = str(self.ref(ctx.component_reference()))
                left = self.slots(ctx.output_expression_list())
                return Several(left, self.call(name, ctx.function_call_args(), place), place)
            case "Statement_ifContext":
                return self.conditional(ctx.if_statement(), self.statements, place)
            case "Statement_forContext":
                return self.loop(ctx.for_statement(), self.statements, place)
            case "Statement_whileContext":
                node = ctx.while_statement()
                return While(self.expression(node.condition), self.statements(node.block), place)
            case "Statement_whenContext":
                node = ctx.when_statement()
                pairs = zip(node.conditions, node.blocks, strict=True)
                return When(tuple((self.expression(c), self.statements(b)) for c, b in pairs), place)
            case _:
                return Jump(ctx.getText(), place)

    def conditional(self, ctx: Any, body: Any, place: Place) -> If:
        """If-equation or if-statement."""
        conditions = [self.expression(node) for node in ctx.conditions]
        blocks = [body(node) for node in ctx.blocks]
        otherwise = blocks.pop() if len(blocks) > len(conditions) else ()
        return If(tuple(zip(conditions, blocks, strict=True)), otherwise, place)

    def loop(self, ctx: Any, body: Any, place: Place) -> For:
        """Read a for loop; several indices become nested loops."""
        inner: Body = body(ctx.block)
        for node in reversed(ctx.indices.for_index()):
            if node.expression() is None:
                raise ExportError(place, "a for loop needs a range: 'for i in 1:n loop'")
            inner = (For(node.IDENT().getText(), self.expression(node.expression()), inner, place),)
        result = inner[0]
        assert isinstance(result, For)
        return result

    # ----------------------------------------------------------- expressions

    def expression(self, ctx: Any) -> Expr:
        """Any expression."""
        if type(ctx).__name__ == "Expression_ifContext":
            conditions = [self.expression(node) for node in ctx.conditions]
            values = [self.expression(node) for node in ctx.blocks]
            return Choice(tuple(zip(conditions, values, strict=False)), values[-1], self.place(ctx))
        return self.simple(ctx.simple_expression())

    def simple(self, ctx: Any) -> Expr:
        """An expression or a range `a:b`, `a:step:b`."""
        parts = [self.expr(node) for node in ctx.expr()]
        if len(parts) == 1:
            return parts[0]
        step = parts[1] if len(parts) == 3 else None
        return Range(parts[0], step, parts[-1], self.place(ctx))

    def expr(self, ctx: Any) -> Expr:
        """An operator with its operands, or a primary expression."""
        place, form = self.place(ctx), type(ctx).__name__
        match form:
            case "Expr_primaryContext":
                return self.primary(ctx.primary())
            case "Expr_signedContext":
                return Operation(ctx.op.text, (self.expr(ctx.expr()),), place)
            case "Expr_notContext":
                return Operation("not", (self.expr(ctx.expr()),), place)
            case "Expr_expContext":
                base, power = (self.primary(node) for node in ctx.primary())
                return Operation(ctx.op.text, (base, power), place)
            case "Expr_andContext" | "Expr_orContext":
                operator = "and" if form == "Expr_andContext" else "or"
            case _:
                operator = ctx.op.text
        left, right = (self.expr(node) for node in ctx.expr())
        return Operation(operator, (left, right), place)

    def primary(self, ctx: Any) -> Expr:
        """Literals, names, calls, arrays, parentheses."""
        place, text = self.place(ctx), ctx.getText()
        match type(ctx).__name__:
            case "Primary_unsigned_numberContext":
                try:
                    number = int(text) if text.isdigit() else float(text)
                except ValueError:
                    raise ExportError(place, f"'{text}' is not a number") from None
                if number > (LARGEST_INTEGER if isinstance(number, int) else sys.float_info.max):
                    raise ExportError(place, f"{text} is too large for a number of this type")
                return Number(number, place)
            case "Primary_stringContext":
                return Text(self.string(text), place)
            case "Primary_trueContext":
                return Truth(value=True, place=place)
            case "Primary_falseContext":
                return Truth(value=False, place=place)
            case "Primary_component_referenceContext":
                return self.ref(ctx.component_reference())
            case "Primary_functionContext":
                name = self.ref(ctx.component_reference())
                if any(part.subscripts for part in name.parts):
                    raise ExportError(place, f"'{text}': arrays of functions are not supported")
                return self.call(str(name), ctx.function_call_args(), place)
            case "Primary_derivativeContext":
                return self.call("der", ctx.function_call_args(), place)
            case "Primary_initialContext":
                return self.call("initial", ctx.function_call_args(), place)
            case "Primary_output_expression_listContext":
                inner = ctx.output_expression_list()
                if inner.getChildCount() != 1:
                    raise ExportError(
                        place, "a list of outputs is only allowed on the left side of '=' or ':='"
                    )
                return self.expression(inner.getChild(0))
            case "Primary_expression_listContext":
                rows = tuple(
                    ArrayOf(tuple(self.expression(node) for node in row.expression()), place)
                    for row in ctx.expression_list()
                )
                return ArrayOf(rows, place)
            case "Primary_function_argumentsContext":
                arguments, named = self.arguments(ctx.function_arguments(), place)
                if named:
                    raise ExportError(place, "an array has no named elements")
                return ArrayOf(arguments, place)
            case _:
                return End(place)

    def call(self, name: str, ctx: Any, place: Place) -> Call:
        """A call with its arguments."""
        inner = ctx.function_arguments()
        arguments, named = self.arguments(inner, place) if inner else ((), ())
        return Call(name.lstrip("."), arguments, named, place)

    def arguments(self, ctx: Any, place: Place) -> tuple[tuple[Expr, ...], tuple[tuple[str, Expr], ...]]:
        """Positional and named arguments."""
        if ctx.for_indices():
            raise ExportError(
                place, "'for' inside an array or a call is not supported; use a function with a loop"
            )
        named: list[tuple[str, Expr]] = []
        if ctx.named_arguments():
            for node in ctx.named_arguments().named_argument():
                named.append((node.IDENT().getText(), self.argument(node.function_argument())))
        return tuple(self.argument(node) for node in ctx.function_argument()), tuple(named)

    def argument(self, ctx: Any) -> Expr:
        """One argument."""
        if type(ctx).__name__ == "Argument_functionContext":
            raise ExportError(self.place(ctx), "functions as arguments are not supported")
        return self.expression(ctx.expression())

    def ref(self, ctx: Any) -> Ref:
        """A dotted name with subscripts."""
        parts = tuple(
            Part(node.IDENT().getText(), self.subscripts(node.array_subscripts()))
            for node in ctx.component_reference_element()
        )
        return Ref(parts, self.place(ctx))

    def subscripts(self, ctx: Any) -> tuple[Expr, ...]:
        """`[1, :]`."""
        if ctx is None:
            return ()
        return tuple(
            self.expression(_one(node.expression())) if node.expression() else Colon(self.place(node))
            for node in ctx.subscript()
        )
