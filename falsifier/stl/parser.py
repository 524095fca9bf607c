"""Parser: exactly one formula, or an error that points to the position of the mistake.

Operators, lowest precedence first::

    <->  <=>                        left associative
    ->   =>                         right associative
    or   |   ||                     left associative
    and  &   &&                     left associative
    U[a,b]   until[a,b]             right associative
    not  !   G[a,b]  always[a,b]  F[a,b]  eventually[a,b]  X  next
    <  <=  >  >=  ==  !=            chains: 1 <= x <= 3 means 1 <= x and x <= 3
    +  -                            left associative
    *  /                            left associative
    -x
    ^                               right associative, so -x^2 is -(x^2)
    numbers, names, true, false, abs sqrt exp log sin cos min max, parentheses

So ``G[0,5] x <= 3 -> y <= 1`` means ``(G[0,5] (x <= 3)) -> (y <= 1)``. Windows are closed intervals, in
seconds unless each bound has a unit (``us ms s min h``); an operator without a window extends to the stop
time. A signal on its own is Boolean: ``b`` means ``b >= 0.5``. Names: see ``falsifier.stl.lexer``.
"""

import math
from collections.abc import Callable
from decimal import Decimal
from typing import NoReturn, cast

from falsifier.errors import FormulaError, did_you_mean
from falsifier.stl import expression, formula as stl, lexer

# Parsing, compiling and printing recurse; this keeps them below Python's recursion limit.
MAX_DEPTH = 100
# Maximum number of characters of a formula.
MAX_LENGTH = 20_000
# Maximum bound of a window in s: in samples, and added up over all levels, it is still a number.
_MAX_BOUND = 1e100
# Bounds in different units that differ relatively by less, in the wrong order, are equal but for rounding.
_ROUNDED = 1e-5

_LEVELS: dict[str, int] = {
    "<->": stl.EQUIVALENCE, "->": stl.IMPLICATION, "or": stl.DISJUNCTION, "and": stl.CONJUNCTION,
    "U": stl.UNTIL, "+": expression.SUM, "-": expression.SUM, "*": expression.PRODUCT,
    "/": expression.PRODUCT, "^": expression.POWER,
    **{symbol: stl.COMPARISON for symbol in stl.OPPOSITE},
}  # fmt: skip
_RIGHT_ASSOCIATIVE = {"->", "U", "^"}
_CONNECTIVES: dict[str, Callable[[stl.Formula, stl.Formula], stl.Formula]] = {
    "<->": stl.Iff, "->": stl.Implies, "or": stl.Or, "and": stl.And,
}  # fmt: skip
_PREFIXES: dict[str, Callable[..., stl.Formula]] = {
    "not": stl.Not, "X": stl.Next, "G": stl.Always, "F": stl.Eventually,
}  # fmt: skip
_CLOSED = "only closed windows in seconds are supported: [a,b]"


def parse(text: str) -> stl.Formula:
    """Parse a text that is exactly one formula.

    Raises:
        FormulaError: with the position of the mistake, a caret under it and a hint.
    """
    if not isinstance(text, str):
        raise FormulaError(f"expected the text of a formula, got {text!r}")
    return _Parser(text).formula()


class _Parser:
    """Precedence climbing with one grammar for formulas and expressions; operators check their operands."""

    def __init__(self, text: str) -> None:
        if len(text) > MAX_LENGTH:
            raise FormulaError(
                f"the formula has {len(text):,} characters, more than {MAX_LENGTH:,}; split it into several "
                "requirements"
            )
        self.text = text
        self.tokens = lexer.tokenize(text)
        self.index = 0
        self.depth = 0

    @property
    def _next(self) -> lexer.Token:
        return self.tokens[self.index]

    def _take(self) -> lexer.Token:
        token = self._next
        self.index += 1
        return token

    def _accept(self, symbol: str) -> bool:
        is_next = self._next.kind == "symbol" and self._next.text == symbol
        self.index += is_next
        return is_next

    # -- the grammar -------------------------------------------------------------------------------------

    def formula(self) -> stl.Formula:
        if self._next.kind == "end":
            self._fail("the formula is empty", 0, "for example: G[0,20] (speed <= 120)")
        formula = self._as_formula(self._climb(stl.EQUIVALENCE), 0)
        rest = self._next
        if rest.kind != "end":
            hint = lexer.hint_after(rest, self.tokens[self.index - 1])
            self._fail(f"unexpected {rest.shown} after a complete formula", rest.position, hint)
        if _depth(formula) > MAX_DEPTH:
            self._fail_depth(0)
        formula = stl.without_constants(formula)
        if isinstance(formula, stl.Constant):
            self._fail(f"the formula is always {formula}", 0, "compare a signal, for example speed <= 120")
        return formula

    def _climb(self, level: int) -> stl.Node:
        """Parse everything of at least this precedence."""
        self.depth += 1
        if self.depth > MAX_DEPTH:
            self._fail_depth(self._next.position)
        start = self._next.position
        left = self._operand(level)
        while self._next.kind == "symbol" and _LEVELS.get(self._next.text, -1) >= level:
            token = self._take()
            here = _LEVELS[token.text]
            after = here if token.text in _RIGHT_ASSOCIATIVE else here + 1
            if token.text == "U":
                window, right = self._window(), self._formula_at(after)
                left = stl.Until(self._as_formula(left, start), right, window)
            elif token.text in _CONNECTIVES:
                left = _CONNECTIVES[token.text](self._as_formula(left, start), self._formula_at(after))
            elif here == stl.COMPARISON:
                left = self._chain(self._as_expression(left, start), token)
            else:
                term = self._as_expression(left, start)
                left = expression.Arithmetic(
                    cast(expression.Operator, token.text), term, self._expression_at(after)
                )
        self.depth -= 1
        return left

    def _formula_at(self, level: int) -> stl.Formula:
        start = self._next.position
        return self._as_formula(self._climb(level), start)

    def _expression_at(self, level: int) -> expression.Expression:
        start = self._next.position
        return self._as_expression(self._climb(level), start)

    def _chain(self, left: expression.Expression, token: lexer.Token) -> stl.Formula:
        right = self._expression_at(expression.SUM)
        formula: stl.Formula = stl.Predicate(cast(stl.Comparison, token.text), left, right)
        while self._next.kind == "symbol" and _LEVELS.get(self._next.text) == stl.COMPARISON:
            token = self._take()
            left, right = right, self._expression_at(expression.SUM)
            formula = stl.And(formula, stl.Predicate(cast(stl.Comparison, token.text), left, right))
        return formula

    def _operand(self, level: int) -> stl.Node:
        token = self._take()
        if token.kind == "number":
            value = float(token.text)
            if not math.isfinite(value):
                self._fail(f"the number {token.text} is too large", token.position, "the maximum is 1.8e308")
            return expression.Number(value)
        if token.kind == "name":
            return self._named(token)
        if token.text == "(":
            inside = self._climb(stl.EQUIVALENCE)
            self._close(token)
            return inside
        if token.text == "-":
            operand = self._expression_at(expression.SIGN)
            if isinstance(operand, expression.Number):
                return expression.Number(0.0 - operand.value)
            return expression.Negative(operand)
        if token.text in ("true", "false"):
            return stl.Constant(token.text == "true")
        if token.text in lexer.FUNCTIONS:
            return self._call(token)
        if token.text in _PREFIXES:
            if level > stl.PREFIX:
                self._fail(
                    f"{token.shown} starts a formula, but a number or a signal is expected here",
                    token.position,
                    f'is a parenthesis missing? Write a signal of that name as "{token.written}"',
                )
            window = (self._window(),) if token.text in "GF" else ()
            return _PREFIXES[token.text](self._formula_at(stl.PREFIX), *window)
        problem = f"expected a formula, a signal or a number, not {token.shown}"
        if token.kind == "end":
            problem = "the formula ends too early"
        self._fail(problem, token.position, lexer.hint_at(self.tokens, self.index - 1))

    def _named(self, token: lexer.Token) -> expression.Name:
        if self._next.kind == "symbol" and self._next.position == token.end:
            if self._next.text == "(":
                hint = lexer.hint_for(token) or did_you_mean(token.text, lexer.FUNCTIONS)
                if self.tokens[self.index + 1].text == "t":
                    hint = f"write signals without (t): {token.text}"
                self._fail(f"unknown function {token.text!r}", token.position, hint)
            if self._next.text == "[":
                self._fail(
                    f"the index of {token.text!r} cannot be read",
                    self._next.position,
                    lexer.hint_for(token)
                    or "indices are integers, as in x[1,2]; put any other name in double quotes",
                )
        return expression.Name(token.text)

    def _call(self, token: lexer.Token) -> expression.Call:
        opening = self._take()
        operands = [self._expression_at(expression.SUM)]
        while self._accept(","):
            operands.append(self._expression_at(expression.SUM))
        self._close(opening)
        is_pair = token.text in ("min", "max")
        if is_pair != (len(operands) > 1):
            wanted = "two or more expressions" if is_pair else "one expression"
            hint = "for the maximum over time, write G (x <= 3)" if is_pair else "check commas"
            self._fail(f"{token.text} expects {wanted}, got {len(operands)}", token.position, hint)
        return expression.Call(cast(expression.Function, token.text), tuple(operands))

    def _close(self, opening: lexer.Token) -> None:
        if not self._accept(")"):
            token, closes = self._next, f"it closes the '(' at position {opening.position + 1}"
            before = self.tokens[self.index - 1]
            is_operator = len(before.text) > 1 or token.text in ("[", "(")  # a capital may be a signal
            hint = lexer.hint_for(token) or (lexer.hint_for(before) if is_operator else "")
            hint = hint or (closes if token.kind in ("end", "symbol") else lexer.JOIN)
            self._fail(f"expected ')' before {token.shown}", token.position, hint)

    # -- windows -----------------------------------------------------------------------------------------

    def _window(self) -> stl.Window | None:
        bracket = self._next
        if bracket.text == "(" and self._looks_like_open_window():
            self._fail("open windows are not supported", bracket.position, _CLOSED)
        if not self._accept("["):
            return None
        start_text, start_unit = self._bound()
        if not self._accept(","):
            self._fail("expected ',' between the bounds", self._next.position, _CLOSED)
        end_token = self._next
        end_text, end_unit = self._bound()
        if not self._accept("]"):
            self._fail(f"expected ']' before {self._next.shown}", self._next.position, _CLOSED)
        if float(start_text) > 0 and bool(start_unit) != bool(end_unit):
            self._fail(
                "one bound has a unit, the other does not",
                bracket.position,
                f"give both a unit, for example [{start_text}{start_unit or end_unit},"
                f"{end_text}{end_unit or start_unit}]",
            )
        window = stl.Window(_seconds(start_text, start_unit), _seconds(end_text, end_unit))
        # [1.3333333s,0.0222222min] is one moment, the bound in the smaller unit; [1h,3600.01s] may be meant.
        tolerance = _ROUNDED if window.start > window.end else _ROUNDED**2
        if start_unit != end_unit and math.isclose(window.start, window.end, rel_tol=tolerance):
            moment = (
                window.start if lexer.UNITS[start_unit or "s"] < lexer.UNITS[end_unit or "s"] else window.end
            )
            window = stl.Window(moment, moment)
        if window.start > window.end:
            self._fail(
                f"the window {window} ends before it starts",
                bracket.position,
                f"write the smaller bound first: {stl.Window(window.end, window.start)}",
            )
        if window.end > _MAX_BOUND:
            self._fail("the bound is too large", end_token.position, "omit the window")
        return window

    def _bound(self) -> tuple[str, str]:
        token = self._take()
        if token.kind != "number":
            hint = {
                "-": "windows look forward: bounds are at least 0",
                "inf": "omit the window to extend it to the stop time",
            }.get(token.text, f"bounds are numbers; {_CLOSED}")
            self._fail(f"expected a bound, not {token.shown}", token.position, hint)
        unit = ""
        if self._next.kind == "name":
            word = self._take()
            unit = word.text
            if unit not in lexer.UNITS:
                self._fail(f"unknown unit {unit!r}", word.position, did_you_mean(unit, lexer.UNITS))
        return token.text, unit

    def _looks_like_open_window(self) -> bool:
        first, comma, _, last = (self.tokens[self.index + 1 :] + self.tokens[-1:] * 4)[:4]
        ends = last.text in (")", "]") or last.kind == "name"  # the unit of a bound; else (1,5 < x)
        return first.kind == "number" and comma.text == "," and ends

    # -- what went wrong ---------------------------------------------------------------------------------

    def _as_formula(self, node: stl.Node, start: int) -> stl.Formula:
        if isinstance(node, stl.Formula):
            return node
        if isinstance(node, expression.Name):
            return stl.Flag.of(node)
        is_number = isinstance(node, expression.Number)
        what = "a number" if is_number else "an expression"
        hint = f"compare it, for example {f'x == {node}' if is_number else f'{node} >= 0'}"
        if "=>" in self.text:
            hint += "; => is an implication, greater or equal is >="
        self._fail(f"expected a formula, got {what}, {node}", start, hint)

    def _as_expression(self, node: stl.Node, start: int) -> expression.Expression:
        if isinstance(node, expression.Expression):
            return node
        hint = "comparisons and arithmetic need numbers and signals; join formulas with and, or, ->, <->"
        if isinstance(node, stl.Constant):
            hint = "write a Boolean signal b as b or not b"
        hint = next((cure for arrow, cure in lexer.ARROWS.items() if arrow in self.text), hint)
        self._fail("expected a number or a signal, got a formula", start, hint)

    def _fail_depth(self, position: int) -> NoReturn:
        self._fail(
            f"the formula has more than {MAX_DEPTH} levels", position, "split it into several requirements"
        )

    def _fail(self, problem: str, position: int, hint: str) -> NoReturn:
        raise lexer.syntax_error(self.text, problem, position, hint)


def _seconds(bound: str, unit: str) -> float:
    """Return a bound in s without the rounding of a product: 0.29 min are 17.4 s."""
    value = float(bound)
    return float(Decimal(bound) * lexer.UNITS[unit or "s"]) if 0.0 < value < math.inf else value


def _depth(formula: stl.Formula) -> int:
    # Iterative: a chain such as ``a and b and ...`` is parsed in a loop and may be too deep to recurse into.
    deepest = 0
    below: list[tuple[stl.Node, int]] = [(formula, 1)]
    while below:
        node, depth = below.pop()
        deepest = max(deepest, depth)
        below.extend((part, depth + 1) for part in stl.parts_of(node))
    return deepest
