"""The array type of the engines: single precision where models are rolled out, double elsewhere."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
