"""`delay` and `spatialDistribution`: each becomes a delay line with variables of its own."""

from __future__ import annotations

from itertools import pairwise

from ..read.syntax import Call, ExportError, Expr, Place, Several
from . import fold
from .instance import Evaluation
from .ir import DelayLine, Equation, Lit, Scalar, Tensor, Time, Var, Variable, is_delayed
from .tensors import cast, fitted, scalar_tensor

_ARGUMENTS = ("in0", "in1", "x", "positiveVelocity", "initialPoints", "initialValues")

Seeds = tuple[tuple[Scalar, Scalar], ...]


def delay(here: Evaluation, call: Call) -> Tensor:
    """Translate `delay(expression, delayTime)` and `delay(expression, delayTime, delayMax)`."""
    if len(call.arguments) not in (2, 3):
        raise ExportError(
            call.place, "'delay' expects 2 or 3 arguments: delay(expression, delayTime, delayMax)"
        )
    value, back, *most = (cast(here.scalar(text), "Real", call.place) for text in call.arguments)
    span = most[0] if most else back
    if not here.parametric(span):
        what = "'delayMax'" if most else "a delay time without 'delayMax'"
        raise ExportError(call.place, f"{what} must be a parameter or a literal")
    return scalar_tensor(_line(here, Time(), value, back, span, (), call.place))


def spatial_distribution(here: Evaluation, item: Several) -> list[Equation]:
    """Translate `(out0, out1) = spatialDistribution(...)` for a medium that flows in one direction."""
    call = item.right
    assert isinstance(call, Call)
    given = _arguments(call)
    if here.scalar(given["positiveVelocity"]) != Lit(value=True, type="Boolean"):
        raise ExportError(call.place, "'spatialDistribution' is only supported with positiveVelocity = true")
    value, x = (cast(here.scalar(given[name]), "Real", call.place) for name in ("in0", "x"))
    if len(item.left) > 2:
        raise ExportError(call.place, f"'spatialDistribution' has 2 outputs, not {len(item.left)}")
    made = []
    if item.left[0] is not None:
        made.append(Equation(here.scalar(item.left[0]), value, item.place))
    if len(item.left) == 2 and item.left[1] is not None:
        one = Lit(1.0, "Real")
        out = _line(here, x, value, one, one, _seeds(here, given, call.place), call.place)
        made.append(Equation(here.scalar(item.left[1]), out, item.place))
    return made


def _arguments(call: Call) -> dict[str, Expr]:
    given = dict(zip(_ARGUMENTS, call.arguments, strict=False))
    for name, text in call.named:
        if name not in _ARGUMENTS or name in given:
            raise ExportError(call.place, f"'spatialDistribution' has no argument '{name}', or has it twice")
        given[name] = text
    if len(call.arguments) > len(_ARGUMENTS):
        raise ExportError(call.place, f"'spatialDistribution' expects at most {len(_ARGUMENTS)} arguments")
    for name in _ARGUMENTS[:4]:
        if name not in given:
            raise ExportError(call.place, f"the argument '{name}' of 'spatialDistribution' is missing")
    return given


def _seeds(here: Evaluation, given: dict[str, Expr], place: Place) -> Seeds:
    """Return the initial content of the line, beginning with what flows out first."""
    ends = Tensor((2,), (Lit(0.0, "Real"), Lit(1.0, "Real")), "Real")
    points = here.value(given["initialPoints"]) if "initialPoints" in given else ends
    distances = [here.static(item, place).value for item in points.items]
    if distances[0] != 0 or distances[-1] != 1 or any(a >= b for a, b in pairwise(distances)):
        raise ExportError(place, "'initialPoints' of spatialDistribution must rise from 0 to 1")
    zeros = Tensor(points.dims, (Lit(0.0, "Real"),) * len(distances), "Real")
    values = here.value(given["initialValues"]) if "initialValues" in given else zeros
    values = fitted(values, points.dims, "Real", place)
    if not all(here.parametric(item) for item in values.items):
        raise ExportError(place, "'initialValues' of spatialDistribution must be parameters or literals")
    return tuple((Lit(float(d), "Real"), v) for d, v in zip(distances, values.items, strict=True))[::-1]


def _line(
    here: Evaluation, key: Scalar, value: Scalar, back: Scalar, span: Scalar, seeds: Seeds, place: Place
) -> Scalar:
    """Add a delay line; return the value that comes out of it."""
    if here.sink is None or not here.events:
        raise ExportError(
            place,
            "'delay' and 'spatialDistribution' are only allowed in equations, outside 'when' and 'noEvent'",
        )
    variables = here.model.variables
    number = 1 + sum(is_delayed(name) and name.endswith(".out") for name in variables)
    made = []
    for part in ("key", "in", "at", "out"):
        name = f"$delay{number}.{part}"
        variables[name] = Variable(
            name, "Real", "continuous", "local", public=False, final=False, place=place
        )
        made.append(Var(name, "Real"))
    passed, entered, position, out = made
    here.sink(Equation(passed, key, place))
    here.sink(Equation(entered, value, place))
    here.sink(Equation(position, fold.arithmetic("-", (passed, back), place), place))
    here.sink(DelayLine(passed, entered, position, out, span, seeds, place))
    return out
