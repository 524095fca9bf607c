"""Statements of a source in the order in which it has them, and those that some names lead to."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from falsifier.context.tokens import written


@dataclass(eq=False, slots=True)
class Statement:
    """A statement, equation, declaration, or head of others.

    Attributes:
        source: the text that it is from.
        start: its first character there, from 0.
        end: the character behind it.
        line: its first line, from 1.
        scope: class or function in which it stands; empty outside.
        outer: the head of what is around it.
        sets: names that it declares or gives a value to.
        uses: all names in it.
        value: where its value is written, if it gives one to a single name at all times.
        follows: whether it is kept if the head around it is: an end, a jump, a section.
        is_declaration: whether it declares names.
        is_given: whether these are inputs, constants or have a value of their own.
        is_told: whether it says anything; annotations do not.
        behind: if an annotation that is not told follows, the character behind that; otherwise 0.
    """

    source: str
    start: int
    end: int
    line: int
    scope: str = ""
    outer: "Statement | None" = None
    sets: frozenset[str] = frozenset()
    uses: frozenset[str] = frozenset()
    value: tuple[int, int] | None = None
    follows: bool = False
    is_declaration: bool = False
    is_given: bool = False
    is_told: bool = True
    behind: int = 0

    @property
    def text(self) -> str:
        """Its text in one line."""
        return written(self.source, self.start, self.end)


def reached(
    statements: Iterable[Statement], seeds: Iterable[str], scopes: Iterable[str]
) -> tuple[set[str], set[Statement]]:
    """Return the names that are met from some on, and the statements that say something of these.

    A statement that sets a name is kept, with the heads around it; what they use is met next. A variable that
    is declared, and neither given nor set, is met in all statements that contain it. A function is met if
    anything in it is kept.

    Args:
        statements: all statements.
        seeds: the names to begin with.
        scopes: names of functions.
    """
    setting: dict[str, list[Statement]] = defaultdict(list)
    containing: dict[str, list[Statement]] = defaultdict(list)
    following: dict[Statement | None, list[Statement]] = defaultdict(list)
    known: set[str] = set()
    functions = frozenset(scopes)
    for statement in statements:
        for name in statement.sets:
            setting[name].append(statement)
            if not statement.is_declaration or statement.is_given:
                known.add(name)
        for name in statement.uses - statement.sets:
            containing[name].append(statement)
        if statement.follows:
            following[statement.outer].append(statement)
    met: set[str] = set()
    kept: set[Statement] = set()
    queue = list(seeds)
    while queue:
        name = queue.pop()
        if name in met:
            continue
        met.add(name)
        is_unknown = name in setting and name not in known
        for each in setting[name] + containing[name] if is_unknown else setting[name]:
            at: Statement | None = each
            while at is not None and at not in kept:
                kept.add(at)
                kept.update(following[at])
                queue += at.uses
                queue += {at.scope} & functions
                at = at.outer
    return met, kept


def lines_told(statements: Iterable[Statement], kept: set[Statement] | None) -> Iterator[str]:
    """Return the lines of the statements that are kept, with dots where others were left out.

    Args:
        statements: statements of one source, in order.
        kept: None: all.
    """
    told, is_gap = 0, False
    for statement in statements:
        if statement.is_told and kept is not None and statement not in kept:
            is_gap = True
        elif statement.is_told and statement.end > told:
            source = statement.source
            begin = max(told, source.rfind("\n", 0, statement.start) + 1)
            told = source.find("\n", statement.behind or statement.end)
            told = len(source) if told < 0 else told + 1
            if is_gap:
                yield "..."
            yield f"{source[begin : statement.end]};" if statement.behind else source[begin:told].rstrip()
            is_gap = False


def assignments(statements: Iterable[Statement]) -> tuple[dict[str, str], dict[str, frozenset[str]]]:
    """Return what variables are equal to at all times, and what each depends on in one step.

    A variable with several statements, or one under a condition, equals no single expression.
    """
    equal: dict[str, list[str]] = defaultdict(list)
    fed: dict[str, set[str]] = defaultdict(set)
    for statement in statements:
        for name in () if statement.is_declaration and statement.value is None else statement.sets:
            fed[name] |= statement.uses
            equal[name].append(written(statement.source, *statement.value) if statement.value else "")
    return (
        {name: texts[0] for name, texts in equal.items() if len(texts) == 1 and texts[0]},
        {name: frozenset(names) for name, names in fed.items()},
    )
