"""What dynamics get wrong at inputs like these: a kernel regression of their errors.

Linear dynamics that overlook a kink or a mode predict the same wrong thing again and again. Errors at similar
inputs say so (the discrepancy of a model: Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425-464; the
weights are those of Nadaraya and Watson).
"""

from itertools import pairwise

import numpy as np

from falsifier.engines.layout import Array

# Distance of inputs, a share of their ranges, at which an error counts for 0.6 of one at the same input.
_WIDTH = 0.15
# Weight of what is known of no input: no error.
_NO_ERROR = 0.1
# Number of neighbouring cells whose inputs are compared by their means.
_BLOCK = 5


class Corrections:
    """Expects errors of predictions from those at simulated inputs.

    Systems are causal: what inputs do later does not make errors differ.

    Args:
        inputs: scaled inputs of k simulations, shape (k, cells, inputs).
        errors: what was simulated minus what was predicted, in units of the outputs' spread, shape (k,
            cells, outputs).
    """

    def __init__(self, inputs: Array, errors: Array) -> None:
        self._known = _by_block(inputs)
        count, cells, outputs = errors.shape
        filled = np.pad(errors, ((0, 0), (0, -cells % _BLOCK), (0, 0)))
        by_block = filled.reshape(count, len(self._known), _BLOCK * outputs).swapaxes(0, 1).astype(np.float32)
        # One more column, so that a product with weights also returns their sum.
        self._errors = np.pad(by_block, ((0, 0), (0, 0), (0, 1)), constant_values=1.0)
        self._outputs = outputs

    def at(self, inputs: Array) -> Array:
        """Return the errors expected at inputs, shape (m, cells, inputs), as (m, cells, outputs)."""
        count, cells, width = inputs.shape
        new, known = _by_block(inputs), self._known
        # In place: these arrays are the largest of a plan.
        distances = new @ known.swapaxes(1, 2)
        distances *= -2.0
        distances += (new**2).sum(axis=2)[:, :, None]
        distances += (known**2).sum(axis=2)[:, None]
        for before, own in pairwise(distances):
            own += before
        distances /= np.arange(1, len(new) + 1, dtype=np.float32)[:, None, None] * (-2.0 * width * _WIDTH**2)
        errors, total = np.split(np.exp(distances, out=distances) @ self._errors, [-1], axis=2)
        errors = (errors / (_NO_ERROR + total)).swapaxes(0, 1)
        return np.asarray(errors.reshape(count, _BLOCK * len(new), self._outputs)[:, :cells])


def _by_block(inputs: Array) -> Array:
    """Return the mean inputs of blocks of cells, shape (blocks, m, inputs); those of cells as in ``at``."""
    firsts = np.arange(0, inputs.shape[1], _BLOCK)
    means = np.add.reduceat(inputs, firsts, axis=1) / np.diff(firsts, append=inputs.shape[1])[:, None]
    return means.swapaxes(0, 1).astype(np.float32)
