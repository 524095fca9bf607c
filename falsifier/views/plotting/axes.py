"""What all figures share: colours, new axes, text, files; without pyplot, which keeps global state."""

import textwrap
import warnings
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from falsifier.core.files import write_whole
from falsifier.core.literals import one_line
from falsifier.core.ranges import Scale
from falsifier.core.words import shortened

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure


class Colour:
    """Red is kept for violations. What came nearest to one has not the colour of an alarm."""

    OUTPUT, INPUT, VIOLATED, NEAREST = "#1f5fa8", "#2f7d4f", "#b3261e", "#b35900"
    LIMIT, QUIET, EACH = "#333333", "#8a8a8a", "#9aa7b5"


# Maximum number of characters of a title or label.
_LONGEST_CAPTION = 120
# Maximum number of lines of a text that is wrapped.
_MOST_LINES = 4
# Maximum number of names beside an axis; of more, only numbers are shown. And of characters of such a name.
_MOST_TICKS, _LONGEST_TICK = 12, 24
# Width in inches of a character of a label, more or less.
CHARACTER = 0.07


def caption(text: str) -> str:
    """Return a text for a picture: one line, not too long, and without matplotlib's mathematical notation."""
    return shortened(one_line(text), _LONGEST_CAPTION).replace("$", r"\$")


def wrapped(text: str, width: int) -> str:
    """Return a text for a picture, on as many lines of so many characters as it needs, within limits."""
    kept = one_line(text).replace(" = ", "\u00a0=\u00a0")  # not separated by the end of a line
    lines = textwrap.wrap(kept, width, max_lines=_MOST_LINES, placeholder=" ...", break_on_hyphens=False)
    return "\n".join(lines).replace("\u00a0", " ").replace("$", r"\$")


def whole_ticks(axis: "Axis", labels: Mapping[int, str]) -> None:
    """Put ticks at whole numbers only, with their names if they have any."""
    from matplotlib.ticker import MaxNLocator

    if 0 < len(labels) <= _MOST_TICKS:
        names = [caption(shortened(labels[number], _LONGEST_TICK)) for number in sorted(labels)]
        axis.set_ticks(sorted(labels), labels=names)
    else:
        axis.set_major_locator(MaxNLocator(integer=True, min_n_ticks=1))


def set_scale(ax: "Axes", *, x: Scale = "linear", y: Scale = "linear") -> None:
    """Scale axes on which everything is drawn already.

    Over less than two decades, matplotlib labels all multiples of a power of ten, one over the other. There,
    few plain numbers are shown.
    """
    from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter

    ax.set(xscale=x, yscale=y)
    for axis, scale in ((ax.xaxis, x), (ax.yaxis, y)):
        low, high = axis.get_view_interval()
        if scale == "log" and high < 100 * low:
            subs = (1, 3) if high > 15 * low else (1, 2, 5)
            axis.set_major_locator(LogLocator(subs=subs) if high > 5 * low else MaxNLocator(3))
            axis.set_major_formatter("{x:g}")
            axis.set_minor_formatter(NullFormatter())


def fit_labels(ax: "Axes") -> None:
    """Put labels longer than their axis on several small lines; of a very long one, both ends are kept."""
    box, dpi = ax.get_window_extent(), figure_of(ax).dpi
    for label, length in ((ax.xaxis.label, box.width / dpi), (ax.yaxis.label, box.height / dpi)):
        text, width = label.get_text().replace(r"\$", "$"), max(8, int(length / CHARACTER))
        if len(text) > width:
            half = (_MOST_LINES - 1) * width // 2
            kept = text if len(text) <= 2 * half else f"{text[:half]} ... {text[-half:]}"
            label.set(text=wrapped(kept, width), fontsize=8)


def new_figure(width: float, height: float) -> "Figure":
    """Make a figure of this size in inches."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def own_axes(width: float = 8.0, height: float = 4.0) -> "Axes":
    """Make axes that fill a new figure of this size in inches."""
    return new_figure(width, height).subplots()


def figure_of(ax: "Axes") -> "Figure":
    """The figure that axes belong to."""
    from matplotlib.figure import Figure

    figure = ax.get_figure(root=True)
    assert isinstance(figure, Figure)
    return figure


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure; the file extension determines the format."""
    # By which our pictures are told from others, so that these are not replaced.
    key = "Software" if path.suffix.lower() == ".png" else "Creator"
    write_whole(path, _content(figure, path.suffix[1:].lower(), dpi=130, metadata={key: "falsifier"}))


def png(figure: "Figure", *, dpi: int) -> bytes:
    """Return a figure as the content of a PNG file."""
    return _content(figure, "png", dpi=dpi)


def svg(figure: "Figure") -> bytes:
    """Return a figure as the content of an SVG file without a background; equal figures give equal bytes."""
    from matplotlib import rc_context

    with rc_context({"svg.hashsalt": "falsifier"}):
        return _content(figure, "svg", transparent=True, metadata={"Date": None, "Creator": None})


def _content(figure: "Figure", kind: str, **options: Any) -> bytes:
    """Draw a figure; characters that the font lacks, as in names of signals, become boxes without a word."""
    buffer = BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font")
        figure.savefig(buffer, format=kind, **options)
    return buffer.getvalue()
