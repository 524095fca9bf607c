"""Classes of a Modelica file as values, the part that matters of one, and its text."""

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

from falsifier.context.statements import Slice, Statement, heads, rendered, simple, sliced
from falsifier.core.words import counted


@dataclass(frozen=True, slots=True)
class Declaration:
    """One variable, parameter, constant or component.

    Attributes:
        name: its name.
        type: name of its type or class.
        prefixes: ``parameter``, ``input``, ...
        text: the whole declaration in one line.
        value: its value, as written; empty if it has none.
        uses: names in its value and modifiers.
        line: its line.
    """

    name: str
    type: str
    prefixes: tuple[str, ...]
    text: str
    value: str
    uses: frozenset[str]
    line: int


@dataclass(frozen=True, slots=True)
class ModelicaClass:
    """One class.

    Attributes:
        name: its name with those of the packages around it.
        kind: ``model``, ``block``, ``package``, ...
        description: its description string.
        declarations: its elements.
        equations: equations and initial equations.
        algorithms: statements of algorithms.
        bases: classes that it extends.
        definitions: short definitions within it, such as enumerations, as written.
    """

    name: str
    kind: str
    description: str = ""
    declarations: tuple[Declaration, ...] = ()
    equations: tuple[Statement, ...] = ()
    algorithms: tuple[Statement, ...] = ()
    bases: tuple[str, ...] = ()
    definitions: tuple[tuple[str, str], ...] = ()

    @property
    def statements(self) -> tuple[Statement, ...]:
        """Equations and statements of algorithms."""
        return (*self.equations, *self.algorithms)

    @property
    def names(self) -> frozenset[str]:
        """Names of its elements."""
        return frozenset(d.name for d in self.declarations)

    @property
    def constants(self) -> Mapping[str, str]:
        """Values of its parameters and constants, as written."""
        fixed = (d for d in self.declarations if {"parameter", "constant"} & set(d.prefixes))
        return {d.name: d.value for d in fixed if d.value}


def class_for(classes: Iterable[ModelicaClass], names: Collection[str]) -> ModelicaClass | None:
    """Return the class that declares most of these names, the last one on ties; None if no class has any."""
    best, most = None, 0
    for each in classes:
        count = len(each.names & set(names))
        if count >= max(most, 1):
            best, most = each, count
    return best


def with_bases(found: ModelicaClass, classes: Iterable[ModelicaClass]) -> ModelicaClass:
    """Return a class with the elements of those classes that it extends and that were read."""
    known = {each.name.rpartition(".")[2]: each for each in classes}
    merged, missing, queue, seen = found, [], list(found.bases), {found.name}
    while queue:
        name = queue.pop(0)
        base = known.get(name.rpartition(".")[2])
        if base is None or base.name in seen:
            missing += [] if base else [name]
            continue
        seen.add(base.name)
        queue += base.bases
        merged = replace(
            merged,
            declarations=(*base.declarations, *merged.declarations),
            equations=(*base.equations, *merged.equations),
            algorithms=(*base.algorithms, *merged.algorithms),
            definitions=(*base.definitions, *merged.definitions),
        )
    return replace(merged, bases=tuple(missing))


def slice_of(found: ModelicaClass, names: Iterable[str]) -> Slice:
    """Return what variables of a class depend on; ``a.b`` stands for the component ``a``."""
    values = {d.name: d.uses for d in found.declarations}
    given = {"input", "parameter", "constant"}
    unknowns = frozenset(d.name for d in found.declarations if not d.value and not given & set(d.prefixes))
    seeds = {name.partition(".")[0] for name in names}
    return sliced(found.statements, values, seeds, unknowns=unknowns)


def used_classes(
    found: ModelicaClass, kept: Slice | None, classes: Iterable[ModelicaClass]
) -> list[ModelicaClass]:
    """Return other classes that a class uses as types or functions, and those that they use in turn."""
    known = {each.name.rpartition(".")[2]: each for each in classes if each.kind != "package"}
    used: list[ModelicaClass] = []
    queue = [(found, kept)]
    while queue:
        each, part = queue.pop(0)
        names = {d.type for d in each.declarations if part is None or d.name in part.names}
        names |= set().union(*(s.names for s in simple(each.statements))) if part is None else part.names
        for name in sorted(n.rpartition(".")[2] for n in names):
            other = known.get(name)
            if other is not None and other.name != found.name and other not in used:
                used.append(other)
                queue.append((other, None))
    return used


def class_text(found: ModelicaClass, kept: Slice | None) -> str:
    """Return a class in words of Modelica, with only what is kept; None: everything."""
    statements = None if kept is None else kept.kept
    declared = [d for d in found.declarations if kept is None or d.name in kept.names]
    types = {d.type for d in declared}
    lines = [f"{found.kind} {found.name.rpartition('.')[2]}"]
    if found.description:
        lines[0] += f" {found.description}"
    lines += [f"  {text};" for name, text in found.definitions if kept is None or name in types]
    lines += [f"  {d.text};" for d in declared]
    for title, group in (("equation", found.equations), ("algorithm", found.algorithms)):
        inside = list(rendered(group, _All() if statements is None else statements, 1))
        if inside:
            lines += [title, *inside]
    left = len(found.declarations) - len(declared)
    if left:
        lines.append(f"// {counted(left, 'declaration')} left out: no influence on the requirement")
    lines += [f"// extends {name}, which was not read" for name in found.bases]
    return "\n".join(lines)


def conditions(found: ModelicaClass, kept: Slice | None) -> Iterator[tuple[str, int]]:
    """Return the texts of a class in which values are compared, with their lines."""
    everything = _All() if kept is None else kept.kept
    yield from heads(found.statements, everything)
    for statement in simple(found.statements):
        if statement in everything:
            yield statement.text, statement.line
    for d in found.declarations:
        if d.value and (kept is None or d.name in kept.names):
            yield d.value, d.line


class _All(Collection[Statement]):
    """Every statement."""

    def __contains__(self, _: object) -> bool:
        return True

    def __iter__(self) -> Iterator[Statement]:
        return iter(())

    def __len__(self) -> int:
        return 0
