"""A system as boxes and wires: components from left to right in the order in which they step."""

from typing import TYPE_CHECKING

from falsifier.views.model_text import Box, SystemDiagram, Wire, loop_texts
from falsifier.views.plotting.axes import caption, figure_of, own_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Lengths in units of the picture: a row of ports, the head of a box, the gap between boxes, a lane of wires.
_ROW, _HEAD, _GAP, _LANE = 1.0, 1.6, 5.0, 0.6
_STUB, _LETTER, _LEAST_WIDTH, _INCH = 0.8, 0.24, 7.0, 0.28
# Largest side of a picture in inches.
_MOST_INCHES = 200.0
_WIRE, _LATE, _OPEN, _SPARE = "#1f5fa8", "#b8860b", "#a03030", "#999999"


def plot_diagram(found: SystemDiagram) -> "Figure":
    """Draw the components and connections of a system.

    Wires to the next component go straight, wires to later ones above the boxes, wires back below them.
    Dashed ones carry the value of the previous communication point. Ports without a connection have a ring.

    Args:
        found: the system.
    """
    lefts, widths = _columns(found.boxes)
    height = max(_HEAD + _ROW * (len(b.inputs) + len(b.outputs) + bool(b.left_out)) for b in found.boxes)
    around = [w for w in found.wires if w.source not in found.outer]
    size = (lefts[-1] + widths[-1] + 2 * _GAP, height + _LANE * (2 * len(around) + 4) + 2)
    ax = own_axes(*(min(max(_INCH * side, 4.0), _MOST_INCHES) for side in size))
    ax.set_axis_off()
    ends: dict[str, tuple[float, float, int]] = {}
    for k, box in enumerate(found.boxes):
        _draw_box(ax, box, k + 1, lefts[k], widths[k])
        rows = -_HEAD - 0.5 * _ROW
        for row, port in enumerate((*box.inputs, *box.outputs)):
            is_input = row < len(box.inputs)
            ends[port.title] = (lefts[k] if is_input else lefts[k] + widths[k], rows - _ROW * row, k)
    _draw_wires(ax, found, ends, height)
    connected = {end for wire in found.wires for end in (wire.source, wire.target)}
    for box in found.boxes:
        for port in (*box.inputs, *box.outputs):
            if port.title not in connected:
                x, y, _ = ends[port.title]
                end, colour = (x - _STUB, _OPEN) if port in box.inputs else (x + _STUB, _SPARE)
                ax.plot([end, x], [y, y], color=colour, linewidth=1)
                ax.plot([end], [y], marker="o", markerfacecolor="white", color=colour, markersize=4)
    loops = "; ".join(loop_texts(found))
    late = "dashed: value of the previous communication point" if any(w.is_late for w in found.wires) else ""
    ax.set_title(caption(f"{found.name} ({found.method})"), loc="left")
    ax.text(0, 0, caption("; ".join(filter(None, (loops, late)))), transform=ax.transAxes, fontsize=8)
    ax.set_xlim(-_GAP, lefts[-1] + widths[-1] + _GAP)
    return figure_of(ax)


def _columns(boxes: tuple[Box, ...]) -> tuple[list[float], list[float]]:
    """Return left edges and widths of the boxes."""
    lefts, widths, x = [], [], 0.0
    for box in boxes:
        texts = (f"0. {box.name}", box.kind, *(p.label for p in (*box.inputs, *box.outputs)))
        lefts.append(x)
        widths.append(max(_LEAST_WIDTH, _LETTER * max(map(len, texts)) + 1.0))
        x += widths[-1] + _GAP
    return lefts, widths


def _draw_box(ax: "Axes", box: Box, number: int, left: float, width: float) -> None:
    from matplotlib.patches import Rectangle

    rows = len(box.inputs) + len(box.outputs) + bool(box.left_out)
    height = _HEAD + _ROW * rows
    ax.add_patch(Rectangle((left, -height), width, height, facecolor="#f4f6f9", edgecolor="#333333"))
    ax.text(left + 0.3, -0.1, caption(f"{number}. {box.name}"), va="top", fontsize=9, weight="bold")
    ax.text(left + 0.3, -0.85, caption(box.kind), va="top", fontsize=6, color="#555555")
    for row, port in enumerate((*box.inputs, *box.outputs)):
        is_input = row < len(box.inputs)
        x, side = (left + 0.3, "left") if is_input else (left + width - 0.3, "right")
        ax.text(x, -_HEAD - _ROW * (row + 0.5), caption(port.label), va="center", ha=side, fontsize=8)
    if box.left_out:
        more = f"... and {box.left_out} more"
        ax.text(left + 0.3, -height + 0.5 * _ROW, more, va="center", fontsize=7, color="#555555")


def _draw_wires(
    ax: "Axes", found: SystemDiagram, ends: dict[str, tuple[float, float, int]], height: float
) -> None:
    above = below = 0
    beside = [0] * len(found.boxes)
    for wire in found.wires:
        if wire.target not in ends:
            continue
        x2, y2, to = ends[wire.target]
        if wire.source in found.outer:
            _line(ax, wire, [(x2 - 2 * _STUB, y2), (x2, y2)])
            ax.text(x2 - 2.1 * _STUB, y2, caption(wire.source), ha="right", va="center", fontsize=8)
            continue
        if wire.source not in ends:
            continue
        x1, y1, start = ends[wire.source]
        # Wires that leave one box stand side by side.
        shift = 0.3 * (beside[start] % 9)
        beside[start] += 1
        if to == start + 1:
            middle = x1 + 1.2 + shift
            _line(ax, wire, [(x1, y1), (middle, y1), (middle, y2), (x2, y2)])
            continue
        if to > start:
            above += 1
            lane = _LANE * above
        else:
            below += 1
            lane = -height - _LANE * (below + 0.5)
        out, back = x1 + 1.2 + shift, x2 - 1.2 - 0.15 * ((above + below) % 9)
        _line(ax, wire, [(x1, y1), (out, y1), (out, lane), (back, lane), (back, y2), (x2, y2)])


def _line(ax: "Axes", wire: Wire, points: list[tuple[float, float]]) -> None:
    colour, style = (_LATE, "--") if wire.is_late else (_WIRE, "-")
    ax.plot(*zip(*points[:-1], strict=True), color=colour, linestyle=style, linewidth=1.1)
    ax.annotate(
        "", points[-1], points[-2], arrowprops={"arrowstyle": "-|>", "color": colour, "linestyle": style}
    )
    if wire.conversion:
        x, y = points[-2]
        ax.text(x, y, caption(wire.conversion.strip()), fontsize=6, va="bottom", ha="center")
