"""What equations, when clauses and algorithm sections have in common."""

from __future__ import annotations

from dataclasses import replace

from ..read.library import find_class
from ..read.syntax import Body, Call, ExportError, Expr, For, If, Place, Run, Several, Text, When
from . import fold
from .calls import arguments, function_outputs, lifted
from .evaluate import Evaluator
from .ir import Assert, DelayLine, Equation, Initial, Lit, Outputs, Reinit, Scalar, Tensor, Var, walk
from .tensors import fitted

TRUE = Lit(value=True, type="Boolean")


def loop_values(over: Expr, here: Evaluator, place: Place) -> list[Scalar]:
    """Return the values of the index of a for loop."""
    values = here.value(over)
    if len(values.dims) != 1:
        raise ExportError(place, "a for loop needs a range or a vector: 'for i in 1:n loop'")
    return [here.static(item, place) for item in values.items]


def with_index(here: Evaluator, index: str, value: Scalar) -> Evaluator:
    """Return an evaluator for the same scope, with a value for a loop index."""
    scope = here.scope.with_local(index, Tensor((), (value,), value.type))
    return here.at(scope, events=here.events, sink=here.sink)


def outputs(item: Several, here: Evaluator) -> Outputs:
    """`(a, b) = f(x)`."""
    if not isinstance(item.right, Call):
        raise ExportError(item.place, "the right side of '(a, b) =' must be a function call")
    function = find_class(item.right.name, here.scope.cls, item.place)
    results = function_outputs(function, item.right)
    if len(item.left) > len(results):
        raise ExportError(
            item.place, f"'{function.name}' has {len(results)} outputs, but {len(item.left)} are assigned"
        )
    args = arguments(here, function, item.right)
    model = here.model
    model.functions[function.full_name] = function
    made: list[Outputs | Equation | DelayLine] = []
    auxiliary = lifted(here.at(here.scope, sink=made.append), function, args, item.place)
    call = made[0]
    assert isinstance(call, Outputs)
    for name in (n for target in call.targets if target for n in target):
        del model.variables[name]
    targets: list[tuple[str, ...] | None] = []
    for k, result in enumerate(auxiliary):
        ref = item.left[k] if k < len(item.left) else None
        targets.append(None if ref is None else _target_names(here.value(ref), result, item.place))
    return replace(call, targets=tuple(targets))


def _target_names(target: Tensor, result: Tensor, place: Place) -> tuple[str, ...]:
    if target.dims != result.dims or target.type != result.type:
        raise ExportError(
            place,
            f"{result.type}{list(result.dims)} cannot be assigned to {target.type}{list(target.dims)}",
        )
    return tuple(name_of(item, place) for item in target.items)


def set_once(found: dict[str, Equation], more: dict[str, Equation]) -> None:
    """Add equations of one branch by what they set; a variable that is set twice would lose one of them."""
    for name, item in more.items():
        if name in found:
            raise ExportError(item.place, f"'{name}' already has an equation here, at {found[name].place}")
        found[name] = item


def name_of(item: Scalar, place: Place) -> str:
    """Return the name of a variable on a left side."""
    if not isinstance(item, Var):
        raise ExportError(place, "the left side must be a variable")
    return item.name


def refuse_when(body: Body) -> None:
    """Reject when clauses inside if."""
    for item in body:
        if isinstance(item, When):
            raise ExportError(
                item.place, "'when' inside 'if' is not supported; put the condition into the when clause"
            )


def refuse_reinit(edge: Scalar, body: Body) -> None:
    """Reject `reinit` in a when clause that acts at the start, where it would be passed over."""
    if not any(isinstance(part, Initial) for part in walk(edge)):
        return
    for item in body:
        if isinstance(item, Run) and item.call.name == "reinit":
            raise ExportError(
                item.place,
                "'reinit' when 'initial()' is not supported; use an initial equation or a start value",
            )
        if isinstance(item, If):
            for inner in (*(inner for _, inner in item.branches), item.otherwise):
                refuse_reinit(edge, inner)
        if isinstance(item, For):
            refuse_reinit(edge, item.body)


def reinit(call: Call, here: Evaluator, guard: Scalar) -> list[Reinit]:
    """`reinit(x, value)`."""
    if len(call.arguments) != 2:
        raise ExportError(call.place, "'reinit' expects two arguments: reinit(state, value)")
    target, value = (here.value(text) for text in call.arguments)
    value = fitted(value, target.dims, "Real", call.place)
    pairs = zip(target.items, value.items, strict=True)
    return [Reinit(name_of(one, call.place), guard, other, call.place) for one, other in pairs]


def assertion(call: Call, here: Evaluator, guard: Scalar) -> Assert:
    """`assert(condition, message)`."""
    message = assertion_message(call)
    with here.without_events():
        condition = here.scalar(call.arguments[0])
    if guard is not TRUE:
        condition = fold.logic("or", (fold.logic("not", (guard,), call.place), condition), call.place)
    return Assert(condition, message, call.place)


def assertion_message(call: Call) -> str:
    """Return the message of an assert."""
    if len(call.arguments) != 2 or call.named or not isinstance(call.arguments[1], Text):
        raise ExportError(call.place, "'assert' expects a condition and a literal message, and no level")
    return call.arguments[1].value
