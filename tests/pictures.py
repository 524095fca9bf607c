"""What is seen in a picture."""

from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.image import imread

# Of pictures of a simulation: compared outputs, inputs, and what is required and decided.
OUTPUT, INPUT, CRITICAL = "#1f5fa8", "#2f7d4f", "#b3261e"


def colours(picture: Path | bytes) -> set[str]:
    """Colours of a PNG's pixels, as #rrggbb."""
    content = BytesIO(picture if isinstance(picture, bytes) else picture.read_bytes())
    pixels = (255 * imread(content, format="png")[:, :, :3]).round().astype(np.uint8)
    return {f"#{r:02x}{g:02x}{b:02x}" for r, g, b in np.unique(pixels.reshape(-1, 3), axis=0)}
