"""Modes of an output: laws of its acceleration, each of which explains many pieces of its motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from falsifier.engines.box import Array
from falsifier.engines.surrogate.automaton.recording import Motion, Recording

# Largest error of a law, as a share of the typical acceleration.
_TOLERANCE = 0.02
# Share of the motion that the modes must explain.
_EXPLAINED = 0.97
_MOST_MODES = 3
# Samples in smooth pieces that it takes to tell a law from noise.
_FEWEST_SAMPLES = 100
# Pieces that take part in the fits, and rows of each of them.
_MOST_PIECES, _ROWS = 300, 8
# Draws of a few pieces that a law is fitted to.
_DRAWS = 30


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """Laws of one output's acceleration.

    Attributes:
        laws: coefficients of ``features``, shape (modes, features).
        labels: mode of each piece, -1 if no law explains it, shape (pieces,).
    """

    laws: Array
    labels: NDArray[np.intp]


def features(output: Array, velocity: Array, inputs: Array) -> Array:
    """Return what an acceleration is linear in: 1, velocity, output, inputs, and inputs times velocity.

    Args:
        output: shape (m,).
        velocity: shape (m,).
        inputs: shape (m, p).

    Returns:
        Shape (m, 3 + 2 p).
    """
    own = np.stack([np.ones_like(velocity), velocity, output], axis=1)
    return np.concatenate([own, inputs, inputs * velocity[:, None]], axis=1)


def _choices(inputs: int) -> list[list[int]]:
    """Return sets of features for p inputs, the simplest first; the last one has all."""
    driving = list(range(3, 3 + inputs))
    damping = list(range(3 + inputs, 3 + 2 * inputs))
    return [
        [0],
        [0, 1],
        [0, *driving],
        [0, 1, *driving],
        [0, 1, *driving, *damping],
        [0, 1, 2, *driving, *damping],
    ]


@dataclass(frozen=True, slots=True, eq=False)
class _Rows:
    """Rows of a regression, some of each piece, and the first row and the weight of each piece."""

    features: Array
    acceleration: Array
    piece: NDArray[np.intp]
    first: NDArray[np.intp]
    weight: Array

    def errors(self, law: Array) -> Array:
        """Return the largest error of a law in each piece."""
        return np.asarray(np.maximum.reduceat(np.abs(self.features @ law - self.acceleration), self.first))

    def law(self, used: NDArray[np.bool_], chosen: Sequence[int]) -> Array:
        """Fit a law of some features to some rows."""
        law = np.zeros(self.features.shape[1])
        x = self.features[used][:, list(chosen)]
        law[list(chosen)] = np.linalg.lstsq(x, self.acceleration[used], rcond=1e-10)[0]
        return law


def find_modes(recordings: Sequence[Recording], motion: Motion, rng: np.random.Generator) -> Modes | None:
    """Return the fewest, simplest modes that explain an output's motion; None if three do not.

    The pieces that one law explains are found by fits to a few pieces drawn at random (RANSAC: Fischler and
    Bolles, Communications of the ACM 24(6), 1981).
    """
    if motion.samples < _FEWEST_SAMPLES:
        return None
    everything = np.arange(len(motion.pieces))
    drawn = everything
    if len(drawn) > _MOST_PIECES:
        drawn = np.sort(rng.choice(everything, _MOST_PIECES, replace=False))
    rows = _rows(recordings, motion, drawn)
    tolerance = _TOLERANCE * motion.unit
    choices = _choices(recordings[0].inputs.shape[1])
    if _laws(rows, choices[-1], _MOST_MODES, tolerance, rng) is None:
        return None
    laws = _simplest(rows, choices, tolerance, rng)
    if laws is None:
        return None
    whole = _rows(recordings, motion, everything)
    errors = np.stack([whole.errors(law) for law in laws])
    labels = np.where(errors.min(axis=0) < 2 * tolerance, errors.argmin(axis=0), -1)
    return Modes(laws, labels)


def _simplest(
    rows: _Rows, choices: Sequence[Sequence[int]], tolerance: float, rng: np.random.Generator
) -> Array | None:
    """Return the fewest laws that explain enough, of these the ones with the fewest features."""
    for most in range(1, _MOST_MODES + 1):
        for chosen in choices:
            laws = _laws(rows, chosen, most, tolerance, rng)
            if laws is not None:
                return laws
    return None


def _laws(
    rows: _Rows, chosen: Sequence[int], most: int, tolerance: float, rng: np.random.Generator
) -> Array | None:
    """Return at most ``most`` laws that explain enough, shape (laws, features), or None."""
    left = np.ones(len(rows.first), dtype=bool)
    laws: list[Array] = []
    while rows.weight[left].sum() > 1 - _EXPLAINED:
        if len(laws) == most:
            return None
        law, explained = _best_law(rows, chosen, left, tolerance, rng)
        if not explained.any():
            return None
        laws.append(law)
        left &= ~explained
    return np.array(laws)


def _best_law(
    rows: _Rows,
    chosen: Sequence[int],
    left: NDArray[np.bool_],
    tolerance: float,
    rng: np.random.Generator,
) -> tuple[Array, NDArray[np.bool_]]:
    """Return the law that explains most of the pieces left, and which it explains."""
    best, most = np.zeros_like(left), 0.0
    best_law: Array = np.zeros(rows.features.shape[1])
    choice = rows.weight * left / rows.weight[left].sum()
    for draw in range(_DRAWS):
        drawn = rng.choice(len(left), size=1 + draw % 3, p=choice)
        used = np.isin(rows.piece, drawn)
        for _ in range(3):
            law = rows.law(used, chosen)
            explained = (rows.errors(law) < tolerance) & left
            if not explained.any():
                break
            used = explained[rows.piece]
        share = float(rows.weight[explained].sum())
        if share > most:
            best, most, best_law = explained, share, law
        if share >= _EXPLAINED:
            break
    return best_law, best


def _rows(recordings: Sequence[Recording], motion: Motion, drawn: NDArray[np.intp]) -> _Rows:
    """Return evenly spaced rows of the pieces with these indices; weights are their shares of the time."""
    parts, targets, sizes, lengths = [], [], [], []
    for index in drawn:
        piece = motion.pieces[index]
        length = piece.last - piece.first + 1
        count = min(length, _ROWS)
        rows = piece.first + np.arange(count) * (length - 1) // max(count - 1, 1)
        recording = recordings[piece.recording]
        parts.append(
            features(
                recording.outputs[rows + 1, motion.output],
                recording.velocity[rows, motion.output],
                recording.inputs[rows + 1],
            )
        )
        targets.append(recording.acceleration[rows, motion.output])
        sizes.append(len(rows))
        lengths.append(piece.stop - piece.start)
    first = np.concatenate([[0], np.cumsum(sizes)[:-1]])
    weight = np.array(lengths, dtype=np.float64)
    return _Rows(
        np.concatenate(parts),
        np.concatenate(targets),
        np.repeat(np.arange(len(drawn)), sizes),
        first,
        weight / weight.sum(),
    )
