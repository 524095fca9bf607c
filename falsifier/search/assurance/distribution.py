"""The distribution that random simulations are drawn from, in words."""

from falsifier.core.space import InputRange, ParameterRange, SearchSpace


def distribution_text(space: SearchSpace) -> str:
    """Describe what the engine ``uniform`` draws from: each control point and parameter on its own."""
    parts = [_input_text(r, space) for r in space.inputs]
    parts += [f"{p.name} uniform in {_range_text(p)}" for p in space.parameters]
    text = f"{'; '.join(parts)}; all numbers independent of each other"
    if any(r.free is not None for r in space.inputs):
        text += "; signals with other control points, which a search may try, are not drawn"
    return text


def _input_text(r: InputRange, space: SearchSpace) -> str:
    if r.control_points == 1:
        return f"{r.name} constant, uniform in {_range_text(r)}"
    spacing = space.fixed_times(r)[1]
    held = f", held for {r.hold:g} s" if r.hold is not None else ""
    return (
        f"{r.name} with {r.control_points} control points {spacing:.4g} s apart, {r.interpolation}{held}, "
        f"each uniform in {_range_text(r)}"
    )


def _range_text(r: InputRange | ParameterRange) -> str:
    unit = f" {r.unit}" if r.unit else ""
    rounded = "" if r.kind == "real" else ", rounded to an allowed number"
    return f"[{r.low:g}, {r.high:g}]{unit}{rounded}"
