"""What is drawn of a system."""

from itertools import pairwise

from matplotlib.patches import Rectangle

from falsifier.fmu import Component, Coupling
from falsifier.views.model_text import diagram
from falsifier.views.plotting import plot_diagram
from tests.fmu.small_systems import LOOP, component, solved, system


def test_boxes_ports_wires_and_their_kinds_are_drawn() -> None:
    fmus: dict[str, str | Component] = {
        "pi": component("Gain_2", 0.2),
        "plant": "Plant_2",
        "last": solved("Lag_2"),
    }
    model = system(fmus, {**LOOP, "last.u": "plant.y"})
    (axes,) = plot_diagram(diagram(model)).axes
    texts = [text.get_text() for text in axes.texts]
    assert {"1. plant", "2. pi", "3. last", "r [m]", "u [m]"} <= set(texts)
    assert "Gain_2.fmu, co-simulation, every 0.2 s" in texts
    assert texts.count("y [m]") == 3 and "Lag_2.fmu, model-exchange" in texts
    assert axes.get_title("left") == "system (gauss-seidel)"
    dashed = [line for line in axes.get_lines() if line.get_linestyle() == "--"]
    assert len(dashed) == 1, "the controller's value, which the plant gets one step late"
    assert "dashed: value of the previous communication point" in texts
    rings = [line for line in axes.get_lines() if line.get_marker() == "o"]
    assert len(rings) == 2, "pi.r, which can be searched, and last.y, which nobody gets"
    boxes = [p for p in axes.patches if isinstance(p, Rectangle)]
    assert all(a.get_x() + a.get_width() < b.get_x() for a, b in pairwise(boxes))


def test_without_late_wires_nothing_is_dashed_and_loops_are_named() -> None:
    model = system({"plant": "Lead_2", "pi": "Gain_2"}, LOOP, Coupling(loops="iterate"))
    (axes,) = plot_diagram(diagram(model)).axes
    assert not [line for line in axes.get_lines() if line.get_linestyle() == "--"]
    assert "plant, pi: repeated until the outputs agree" in [t.get_text() for t in axes.texts]
