"""What had no effect: samples whose signals are the same for some time after what is chosen differed."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from falsifier.core.candidate import Candidate
from falsifier.core.trajectory import Trajectory
from falsifier.core.words import first_few
from falsifier.llm.prompts.courses import Array
from falsifier.llm.prompts.numbers import coarse_clock, plain
from falsifier.llm.prompts.view import View

# Equal parts of a simulation that are compared, or each time of fewer; parts without effect from which on it
# is told, samples told.
_PARTS, _LONG, _MOST_TOLD = 100, 5, 3
# Samples and names that are listed.
_MOST_LISTED = 6

Checksums = NDArray[np.int64]


@dataclass(slots=True)
class _Alike:
    """Samples with the same signals for some time."""

    numbers: list[int]
    begin: int  # parts until what is chosen differs
    end: int  # parts until the signals do
    differing: set[str] = field(default_factory=set)


@dataclass(slots=True)
class Effects:
    """Compares each sample with those before it."""

    view: View
    # Of each sample its number, its parameters, and checksums of what is recorded and of each input up to the
    # end of each part, shape (1 + inputs, parts).
    _seen: list[tuple[int, dict[str, float], Checksums]] = field(default_factory=list)
    # By the checksum of what they share, and its length.
    _alike: dict[tuple[int, int], _Alike] = field(default_factory=dict)
    _ends: list[str] = field(default_factory=list)  # of the parts, in s

    def add(self, number: int, candidate: Candidate, trajectory: Trajectory) -> None:
        """Add a sample by its number."""
        inside = self.view.inside(trajectory)
        inputs = [r.name for r in self.view.space.inputs]
        if not self.view.recorded or not inside.columns.keys() >= {*inputs, *self.view.recorded}:
            return
        edges = np.linspace(0, len(inside), min(_PARTS, len(inside)) + 1).round().astype(int)
        clock = coarse_clock(self.view.space.stop_time)
        self._ends = [plain(t, clock) for t in inside.times[np.maximum(edges - 1, 0)].tolist()]
        recorded = np.stack([inside[name] for name in self.view.recorded], axis=1)
        columns = (recorded, *(inside[name] for name in inputs))
        found = np.array([_checksums(np.split(column, edges[1:-1])) for column in columns])
        parameters = dict(candidate.parameters)
        best = _Alike([], 0, 0)
        for other, others, known in self._seen if np.ptp(recorded, axis=0).any() else ():
            end, *same = np.minimum.accumulate(found == known, axis=1).sum(axis=1).tolist()
            # An input may differ at the end of its first other part, a parameter does from the start.
            since = {name: parts + 1 for name, parts in zip(inputs, same, strict=True)}
            since |= {name: 0 for name in parameters if parameters[name] != others.get(name)}
            begin = min(since.values(), default=end)
            if end - begin >= max(_LONG, best.end - best.begin + 1):
                best = _Alike([other], begin, end, {name for name, at in since.items() if at <= end - _LONG})
        if best.end:
            alike = self._alike.setdefault((int(found[0, best.end - 1]), best.end), best)
            alike.numbers += [n for n in (*best.numbers, number) if n not in alike.numbers]
            alike.begin, alike.differing = min(alike.begin, best.begin), alike.differing | best.differing
        self._seen.append((number, parameters, found))

    @property
    def text(self) -> str:
        """In which samples what was chosen had no effect for the longest time; empty if in none."""
        longest = sorted(self._alike.values(), key=lambda a: a.begin - a.end)[:_MOST_TOLD]
        told = (
            f"samples {first_few([*map(str, a.numbers)], _MOST_LISTED)} until {self._ends[a.end]} s, though "
            f"{first_few([n for n in self.view.space.names if n in a.differing], _MOST_LISTED)} differed "
            f"from about {self._ends[a.begin]} s on"
            for a in longest
        )
        so_far = "Without effect so far: all recorded signals were the same in "
        return f"{so_far}{'; '.join(told)}." if longest else ""


def _checksums(parts: Iterable[Array]) -> list[int]:
    """Those of the first part, of the first two, and so on."""
    found, last = list[int](), 0
    for part in parts:
        last = crc32((part + 0.0).tobytes(), last)  # there are two zeros, with other bytes
        found.append(last)
    return found
