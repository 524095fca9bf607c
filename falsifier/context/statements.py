"""Statements and equations with what they set and use, and the part of them on which some names depend.

The rule is written down in ``design/context.md``.
"""

import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

_INDENT = "  "
_LEFT_OUT = "..."
# The name before the sign of an assignment.
_TARGET = re.compile(r"(\w+|'[^']*')\s*:?\s*$")


@dataclass(frozen=True, slots=True)
class Branch:
    """Statements under one condition.

    Attributes:
        head: text before them, such as ``when x > 1 then``.
        uses: names in the condition.
        statements: the statements.
    """

    head: str
    uses: frozenset[str]
    statements: tuple["Statement", ...]


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement or equation, or several under conditions.

    Attributes:
        text: in one line; with branches, how it ends.
        line: its line in the source, from 1.
        sets: names that it gives a value to.
        uses: names on which that value depends.
        is_equation: whether any of its names may be what it determines.
        is_mark: whether it only directs what is around it, such as a label or break.
        is_declaration: whether it declares names without giving them a value.
        branches: the statements under conditions.
    """

    text: str
    line: int
    sets: frozenset[str] = frozenset()
    uses: frozenset[str] = frozenset()
    is_equation: bool = False
    is_mark: bool = False
    is_declaration: bool = False
    branches: tuple[Branch, ...] = ()

    @property
    def names(self) -> frozenset[str]:
        """All its names, without those in branches."""
        return self.sets | self.uses


@dataclass(frozen=True, slots=True)
class Slice:
    """What some names depend on.

    Attributes:
        names: these names, and all that they depend on.
        kept: the statements that are kept.
    """

    names: frozenset[str]
    kept: frozenset[Statement]


def sliced(
    statements: Iterable[Statement],
    values: Mapping[str, Collection[str]],
    seeds: Iterable[str],
    *,
    unknowns: Collection[str] = (),
) -> Slice:
    """Return what names depend on: every statement that sets one of them, and so on for what it uses.

    Conditions around a statement count as used by it. An unknown that no statement sets is determined by the
    equations that contain it.

    Args:
        statements: all statements.
        values: names in the declared value of each name.
        seeds: the names.
        unknowns: variables that equations determine: neither inputs nor parameters, without a value of their
            own.
    """
    flat = [pair for statement in statements for pair in _flat(statement, frozenset())]
    setting: dict[str, list[int]] = {}
    containing: dict[str, list[int]] = {}
    for i, (statement, _) in enumerate(flat):
        for name in statement.sets:
            setting.setdefault(name, []).append(i)
        if statement.is_equation:
            for name in statement.names.intersection(unknowns):
                containing.setdefault(name, []).append(i)
    wanted: set[str] = set()
    kept: set[Statement] = set()
    queue = list(seeds)
    while queue:
        name = queue.pop()
        if name in wanted:
            continue
        wanted.add(name)
        queue += values.get(name, ())
        for i in setting.get(name) or containing.get(name) or []:
            statement, conditions = flat[i]
            if statement not in kept:
                kept.add(statement)
                queue += statement.names | conditions
    return Slice(frozenset(wanted), frozenset(kept))


def assignments(
    statements: Iterable[Statement],
) -> tuple[dict[str, str], dict[str, frozenset[str]]]:
    """Return what variables are equal to at all times, and what each depends on in one step.

    A variable with several statements, or one under a condition, equals no single expression.
    """
    equal: dict[str, list[str]] = {}
    used: dict[str, frozenset[str]] = {}
    for outer in statements:
        for statement, _ in _flat(outer, frozenset()):
            if statement.is_declaration:
                continue
            left, _, right = statement.text.rstrip("; ").partition("=")
            target = _TARGET.search(left)
            for name in statement.sets:
                used[name] = used.get(name, frozenset()) | statement.uses
                is_plain = not outer.branches and target is not None and target[1] == name
                equal.setdefault(name, []).append(right.strip() if is_plain else "")
    return {name: texts[0] for name, texts in equal.items() if len(texts) == 1 and texts[0]}, used


def rendered(statements: Sequence[Statement], kept: Collection[Statement], depth: int = 0) -> Iterator[str]:
    """Return the statements that are kept, line by line, with the conditions around them."""
    for statement in statements:
        if not statement.branches:
            if statement in kept or (statement.is_mark and depth > 1):
                yield f"{_INDENT * depth}{statement.text}"
            continue
        if not any(_has_kept(branch, kept) for branch in statement.branches):
            continue
        for branch in statement.branches:
            yield f"{_INDENT * depth}{branch.head}"
            inside = list(rendered(branch.statements, kept, depth + 1))
            yield from inside or [f"{_INDENT * (depth + 1)}{_LEFT_OUT}"]
        if statement.text:
            yield f"{_INDENT * depth}{statement.text}"


def simple(statements: Iterable[Statement]) -> Iterator[Statement]:
    """Return all statements without branches, those in branches too."""
    for statement in statements:
        yield from (inner for inner, _ in _flat(statement, frozenset()))


def heads(statements: Iterable[Statement], kept: Collection[Statement]) -> Iterator[tuple[str, int]]:
    """Return the conditions around the statements that are kept, with the line of the first one."""
    for statement in statements:
        if any(_has_kept(branch, kept) for branch in statement.branches):
            for branch in statement.branches:
                yield branch.head, statement.line
                yield from heads(branch.statements, kept)


def _flat(statement: Statement, conditions: frozenset[str]) -> Iterator[tuple[Statement, frozenset[str]]]:
    if not statement.branches:
        yield statement, conditions
        return
    # An else depends on the conditions before it, so all of them count for all branches.
    around = conditions.union(*(branch.uses for branch in statement.branches))
    for branch in statement.branches:
        for inner in branch.statements:
            yield from _flat(inner, around)


def _has_kept(branch: Branch, kept: Collection[Statement]) -> bool:
    return any(
        inner in kept or any(_has_kept(below, kept) for below in inner.branches)
        for inner in branch.statements
    )
