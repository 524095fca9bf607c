"""What signals were each time that a discrete signal changed, which tells of thresholds and conditions."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import chain, islice, pairwise
from math import inf, nan

import numpy as np

from falsifier.core.trajectory import Trajectory
from falsifier.llm.prompts.courses import Array, jumps
from falsifier.llm.prompts.numbers import column_decimals, plain, value_text
from falsifier.llm.prompts.told_courses import compared_columns
from falsifier.llm.prompts.view import View

# Changes that are told, and the conditions of one; recorded signals and inputs that are looked at, and what
# is compared of several signals.
_MOST_TOLD, _MOST_CONDITIONS, _MOST_RECORDED, _MOST_INPUTS, _MOST_COMPARED = 10, 4, 24, 12, 8
# A condition is a range, or two, as narrow as this share of all values, in which a signal is for no more than
# this share of the time, and in which some signal would be each time by chance with no more than this
# probability.
_NARROW, _SELDOM, _CHANCE = 0.1, 0.6, 0.1
# An input's earlier values are told in place of the new ones if they differ by so much less.
_CLEARLY = 0.5
# Times may differ by one step of the output in so many, which is how accurate they are.
_STEPS = 11
# A signal with so many different values counts: all that lead up are told together, and all that lead down.
_COUNTS = 7
# A signal that changes more often in a sample chatters, and nothing is told of it.
_CHATTERS = 200
# Times of a sample that are looked at for the values that signals have.
_TIMES = 100

_JUMPS, _STARTS = "jumps", "starts to move"  # what a signal that is not discrete does
# It starts if it rested for this share of the time at which the requirement looks.
_REST = 0.03
_HEAD = (
    "So far, signals just before each change of a discrete signal, or jump or start of another one, and "
    "inputs at that time or until then, were as follows; what samples with the same beginning share counts "
    "once:"
)
# What is told of a signal: that it is an input that was just switched, its value, that of an input that may
# just have been switched, for how long it had its value.
_SWITCHED, _VALUE, _UNTIL, _UNCHANGED = (
    "{name} just changed",
    "{name} {values}",
    "{name} {values} until then",
    "{name} unchanged for {values} s",
)
_ORDER = (_SWITCHED, _VALUE, _UNCHANGED)


@dataclass
class Regularities:
    """Collects what was so when discrete signals changed, and others jumped."""

    view: View
    # What is looked at of a sample: at all times, and for times unchanged, when anything was switched.
    _known: list[Array] = field(default_factory=list)
    _switched: list[Array] = field(default_factory=list)
    _levels: defaultdict[str, set[float]] = field(default_factory=lambda: defaultdict(set))
    # By signal and its change, in words and whether it leads up, the values of all signals, then the time, as
    # bytes: samples with the same beginning have the same changes there, which are one.
    _seen: defaultdict[str, defaultdict[tuple[str, bool], dict[bytes, None]]] = field(
        default_factory=lambda: defaultdict(lambda: defaultdict(dict))
    )
    _chattering: set[str] = field(default_factory=set)

    def add(self, trajectory: Trajectory) -> None:
        """Add a sample."""
        inside = self.view.inside(trajectory)
        columns = {**inside.columns, **compared_columns(self.view, inside)}
        if not columns.keys() >= set(self._names):
            return
        values, times = np.stack([columns[name] for name in self._names]), inside.times
        changed = np.diff(values, axis=1, prepend=values[:, :1]) != 0
        since = np.maximum.accumulate(changed * np.arange(len(times)), axis=1)
        unchanged = times - np.roll(times[since], 1, axis=1)
        unchanged[:, 0] = 0.0
        before, first = np.roll(values, 1, axis=1), len(self._names) - len(self._inputs)
        switched = changed[first:].copy()
        switched[:, 1:] |= changed[first:, :-1]  # times are that accurate
        some = slice(None, None, max(1, len(times) // _TIMES))
        self._known.append(np.vstack((values[:, some], values[first:, some], switched[:, some])))
        discrete = self.view.discrete(inside)
        is_switched = [
            n in discrete or (k >= first and changed[k].mean() < _SELDOM) for k, n in enumerate(self._names)
        ]
        at = np.flatnonzero(changed[is_switched].any(axis=0))
        self._switched.append(unchanged[:, at[:: max(1, len(at) // _TIMES)]])
        then = np.vstack((before[:first], values[first:], before[first:], switched, unchanged, times))
        for place, name in enumerate(self._recorded):
            column = inside[name]
            if name in discrete:
                changes = {"": np.flatnonzero(changed[place])}
            else:
                rested = changed[place] & (unchanged[place] >= _REST * times[-1])
                found = jumps(column)
                changes = {_STARTS: np.setdiff1d(np.flatnonzero(rested), found)}
                changes[_JUMPS] = found[found > 1]  # an output may begin anywhere
            if sum(map(len, changes.values())) > _CHATTERS:
                self._chattering.add(name)
            if name in self._chattering:
                continue
            for change, at in changes.items():
                pairs = list(zip(column[at - 1].tolist(), column[at].tolist(), strict=True))
                ends = {v: value_text(self.view, name, v) for v in {*chain(*pairs)} if not change}
                self._levels[name].update(ends)
                rows = then[:, at].T + 0.0  # there are two zeros, with other bytes
                for (old, new), row in zip(pairs, rows, strict=True):
                    told = change or f"{ends[old]} -> {ends[new]}"
                    self._seen[name][told, new > old][row.tobytes()] = None

    @property
    def text(self) -> str:
        """What was so each time, in a line for each change, those of the requirement's signals first."""
        names = [n for n in self._recorded if n in self._seen and n not in self._chattering]
        if not names:
            return ""
        known = [row for parts in (self._known, self._switched) for row in np.concatenate(parts, axis=1)]
        usual = [(row, float(np.ptp(row)) if row.size else nan) for row in known]
        found = (line for name in sorted(names, key=self._is_real) for line in self._of(name, usual))
        lines = [*islice(found, _MOST_TOLD)]
        return "\n".join((_HEAD, *lines)) if lines else ""

    @cached_property
    def _recorded(self) -> tuple[str, ...]:
        return self.view.recorded[:_MOST_RECORDED]

    @cached_property
    def _names(self) -> tuple[str, ...]:
        """Signals that are told, what is compared of several, then inputs."""
        compared = (text for text, side in self.view.compared.items() if len(side.signals) > 1)
        return (*self._recorded, *islice(compared, _MOST_COMPARED), *self._inputs)

    @cached_property
    def _inputs(self) -> tuple[str, ...]:
        names = (r.name for r in self.view.space.inputs if r.name not in self._recorded)
        return tuple(islice(names, _MOST_INPUTS))

    @cached_property
    def _told(self) -> tuple[tuple[str, str], ...]:
        """What is looked at at each change: of which signal, and how it is told."""
        inputs, names = self._inputs, self._names
        forms = ((names, _VALUE), (inputs, _UNTIL), (inputs, _SWITCHED), (names, _UNCHANGED))
        return tuple((name, form) for names, form in forms for name in names)

    def _is_real(self, name: str) -> bool:
        """Whether a signal jumped or started; it may have looked discrete in other samples."""
        return any(change in (_JUMPS, _STARTS) for change, _ in self._seen[name])

    def _of(self, name: str, known: Sequence[tuple[Array, float]]) -> Iterator[str]:
        counts, is_real = len(self._levels[name]) >= _COUNTS, self._is_real(name)
        changes: defaultdict[str, dict[bytes, None]] = defaultdict(dict)
        for (change, is_up), found in self._seen[name].items():
            way = "up" if is_up else "down"
            if is_real:
                way = f"{_STARTS if change == _STARTS else _JUMPS} {way}"
            changes[way if is_real or counts else change] |= found
        for change, found in changes.items():
            seen = np.frombuffer(b"".join(found)).reshape(len(found), -1)[:, :-1]
            if so := self._common(seen.T, known, without="" if is_real else name):
                yield f"- {name} {change}, {len(seen)} times: {', '.join(so[:_MOST_CONDITIONS])}"

    def _common(self, seen: Array, known: Sequence[tuple[Array, float]], *, without: str) -> list[str]:
        """What was in a narrow range each time, and seldom is, the most telling first, times at the end.

        ``seen`` has what is looked at then, ``known`` what it is otherwise and the span of that, one row for
        each.
        """
        found = dict[tuple[int, str], tuple[float, float, str]]()
        for (name, form), values, (usual, span) in zip(self._told, seen, known, strict=True):
            kind = _ORDER.index(_VALUE if form == _UNTIL else form)
            is_told = usual.size and not (name == without and kind == 1)
            ranges = self._ranges(form, values, span) if is_told else []
            share = float(sum(((usual >= low) & (usual <= high)).mean() for low, high in ranges))
            # The first time in each range says where it is.
            by_chance = len(self._told) * share ** (len(values) - len(ranges))
            if not ranges or share > _SELDOM or by_chance > _CHANCE:
                continue
            width = sum(high - low for low, high in ranges)
            if form == _UNTIL and width >= _CLEARLY * found.get((kind, name), (0.0, inf))[1]:
                continue
            told = plain if form == _UNCHANGED else partial(value_text, self.view, name)
            ends = (dict.fromkeys(told(v, column_decimals(usual)) for v in one) for one in ranges)
            text = form.format(name=name, values=" or ".join(map(" to ".join, ends)))
            found[kind, name] = share, width, text
        # How long it had its own value is a time limit, and how long others had theirs since then is chance.
        if own := found.pop((2, without), None):
            is_timer = not any(kind == 0 for kind, _ in found)
            found = {key: each for key, each in found.items() if key[0] < 2}
            found |= {(2, without): own} if is_timer else {}
        return [text for *_, text in sorted((kind, *each) for (kind, _), each in found.items())]

    def _ranges(self, form: str, values: Array, span: float) -> list[tuple[float, float]]:
        """The narrow ranges in which what is looked at was each time, if there are."""
        if form == _SWITCHED:
            return [(1.0, 1.0)] if values.all() else []
        if form != _UNCHANGED:
            return _narrow_ranges(values, span)
        step = self.view.experiment.output_interval
        if values.min() < 2 * step:
            return []
        return _narrow_ranges(values, max(float(values.max()), _STEPS * step))


def _narrow_ranges(values: Array, span: float) -> list[tuple[float, float]]:
    """The narrow range in which values are, as those of a threshold; or two, as those of two; else none."""
    ordered = np.sort(values)
    edges = [0, len(ordered)]
    if ordered[-1] - ordered[0] > _NARROW * span:
        edges.insert(1, int(np.diff(ordered).argmax()) + 1)
    found = [(float(ordered[begin]), float(ordered[end - 1])) for begin, end in pairwise(edges)]
    is_narrow = sum(high - low for low, high in found) <= _NARROW * span
    return found if is_narrow and min(np.diff(edges)) >= len(found) else []
