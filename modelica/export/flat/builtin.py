"""Operators and built-in functions of Modelica over arrays of scalar expressions."""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from math import prod

from ..read.syntax import Call, ExportError, Place
from . import fold
from .delays import delay
from .instance import Evaluation
from .ir import NUMBERS, Der, Floor, Initial, Lit, Op, Pre, Scalar, Tensor, Var
from .tensors import scalar_tensor, tensor

Known = Callable[[Evaluation, Call], Tensor]


def operation(operator: str, operands: list[Tensor], place: Place, *, events: bool) -> Tensor:
    """Any operator on scalars or arrays."""
    if len(operands) == 1:
        return _unary(operator, operands[0], place)
    left, right = operands
    if operator in ("and", "or", *fold.COMPARISONS):
        if left.dims or right.dims:
            raise ExportError(place, f"'{operator}' needs scalars")
        a, b = left.items[0], right.items[0]
        if operator in ("and", "or"):
            return scalar_tensor(fold.logic(operator, (a, b), place))
        return scalar_tensor(fold.comparison(operator, a, b, place, events=events))
    if operator == "*" and left.dims and right.dims:
        return _matrix_product(left, right, place)
    if operator == "^" and (left.dims or right.dims):
        raise ExportError(place, "'^' needs scalars")
    if operator == "/" and right.dims:
        raise ExportError(place, "an array cannot be a divisor; use './'")
    elementwise = operator.startswith(".")
    if operator in ("+", "-") and left.dims != right.dims:
        raise ExportError(
            place, f"the operands of '{operator}' have sizes {list(left.dims)} and {list(right.dims)}"
        )
    return _spread(operator.lstrip("."), left, right, place, elementwise=elementwise)


def _unary(operator: str, operand: Tensor, place: Place) -> Tensor:
    if operator == "+":
        return operand
    if operator == "not":
        return tensor(operand.dims, [fold.logic("not", (item,), place) for item in operand.items])
    return tensor(
        operand.dims, [fold.arithmetic("neg", (item,), place) for item in operand.items], operand.type
    )


def _spread(operator: str, left: Tensor, right: Tensor, place: Place, *, elementwise: bool) -> Tensor:
    if left.dims and right.dims and left.dims != right.dims:
        raise ExportError(
            place,
            f"the sizes {list(left.dims)} and {list(right.dims)} do not match" + " elementwise" * elementwise,
        )
    dims = left.dims or right.dims
    ones = left.items if left.dims == dims else left.items * prod(dims)
    others = right.items if right.dims == dims else right.items * prod(dims)
    return tensor(dims, [fold.arithmetic(operator, pair, place) for pair in zip(ones, others, strict=True)])


def _dot(left: tuple[Scalar, ...], right: tuple[Scalar, ...], place: Place) -> Scalar:
    products = [fold.arithmetic("*", pair, place) for pair in zip(left, right, strict=True)]
    return _sum(products, place)


def _sum(items: list[Scalar], place: Place) -> Scalar:
    if not items:
        return Lit(0.0, "Real")
    total = items[0]
    for item in items[1:]:
        total = fold.arithmetic("+", (total, item), place)
    return total


def _matrix_product(left: Tensor, right: Tensor, place: Place) -> Tensor:
    if len(left.dims) > 2 or len(right.dims) > 2 or left.dims[-1] != right.dims[0]:
        raise ExportError(place, f"the operands of '*' have sizes {list(left.dims)} and {list(right.dims)}")
    inner = left.dims[-1]
    rows = [left.items[k : k + inner] for k in range(0, len(left.items), inner)]
    width = right.dims[1] if len(right.dims) == 2 else 1
    columns = [right.items[k::width] for k in range(width)]
    items = [_dot(row, column, place) for row in rows for column in columns]
    return tensor(left.dims[:-1] + right.dims[1:], items)


def recompute(name: str, known: tuple[Lit, ...], place: Place) -> Scalar:
    """Evaluate an operation whose operands are now known."""
    if name in ("and", "or", "not"):
        return fold.logic(name, known, place)
    if name in fold.COMPARISONS:
        return Lit(fold.COMPARISONS[name](known[0].value, known[1].value), "Boolean")
    if name in fold.REAL_FUNCTIONS:
        return fold.function(name, known, place)
    if name == "real":
        return fold.real(known[0].value)
    if name == "integer":
        return Lit(int(known[0].value // 1), "Integer")
    if name == "ordinal":
        return Lit(known[0].value, "Integer")
    return fold.arithmetic(name, known, place)


def known(name: str) -> bool:
    """Whether a name is a built-in function."""
    return name in _CALLS or name in fold.REAL_FUNCTIONS or name in _REFUSED


def call(evaluator: Evaluation, node: Call) -> Tensor:
    """Evaluate a call of a built-in function."""
    if node.name in _REFUSED:
        raise ExportError(node.place, _REFUSED[node.name])
    if node.named:
        raise ExportError(node.place, f"'{node.name}' does not accept named arguments")
    if not node.arguments and node.name != "initial":
        raise ExportError(node.place, f"'{node.name}' needs arguments")
    if node.name in fold.REAL_FUNCTIONS:
        return _map(evaluator, node, lambda args: fold.function(node.name, args, node.place))
    return _CALLS[node.name](evaluator, node)


def _args(evaluator: Evaluation, node: Call, *counts: int) -> list[Tensor]:
    if len(node.arguments) not in counts:
        raise ExportError(node.place, f"'{node.name}' expects {' or '.join(map(str, counts))} arguments")
    return [evaluator.value(item) for item in node.arguments]


def _map(evaluator: Evaluation, node: Call, make: Callable[[tuple[Scalar, ...]], Scalar]) -> Tensor:
    count = 2 if node.name in ("atan2", "div", "mod", "rem") else 1
    args = _args(evaluator, node, count)
    dims = next((arg.dims for arg in args if arg.dims), ())
    if any(arg.dims not in ((), dims) for arg in args):
        raise ExportError(node.place, f"the arguments of '{node.name}' have different sizes")
    columns = [arg.items if arg.dims == dims else arg.items * prod(dims) for arg in args]
    return tensor(dims, [make(items) for items in zip(*columns, strict=True)])


def _plain(evaluator: Evaluation, node: Call) -> Tensor:
    return _map(evaluator, node, lambda args: fold.arithmetic(node.name, args, node.place))


def _floor(evaluator: Evaluation, arg: Scalar, place: Place) -> Scalar:
    if isinstance(arg, Lit) or arg.type == "Integer" or not evaluator.events:
        return fold.floor_free(arg, place)
    return Floor(arg)


def _rounding(evaluator: Evaluation, node: Call) -> Tensor:
    """floor, ceil, integer."""

    def make(args: tuple[Scalar, ...]) -> Scalar:
        arg, place = args[0], node.place
        if arg.type not in NUMBERS:
            raise ExportError(place, f"'{node.name}' expects a number, not {arg.type}")
        if arg.type == "Integer":
            return arg
        if node.name == "ceil":
            down = _floor(evaluator, fold.arithmetic("neg", (arg,), place), place)
            return fold.arithmetic("neg", (down,), place)
        down = _floor(evaluator, arg, place)
        if node.name == "floor":
            return down
        return Lit(int(down.value), "Integer") if isinstance(down, Lit) else Op("integer", (down,), "Integer")

    return _map(evaluator, node, make)


def _division(evaluator: Evaluation, node: Call) -> Tensor:
    """div, mod, rem: exact for Integers, by floor (with events) for Reals."""

    def make(args: tuple[Scalar, ...]) -> Scalar:
        place = node.place
        if all(arg.type == "Integer" for arg in args) or all(isinstance(arg, Lit) for arg in args):
            return fold.arithmetic(node.name, args, place)
        if node.name != "mod" and evaluator.events:
            raise ExportError(
                place, f"'{node.name}' of Reals creates events, which is not supported; use mod or noEvent"
            )
        if node.name != "mod":
            return fold.arithmetic(node.name, args, place)
        whole = _floor(evaluator, fold.arithmetic("/", args, place), place)
        return fold.arithmetic("-", (args[0], fold.arithmetic("*", (whole, args[1]), place)), place)

    return _map(evaluator, node, make)


def _extreme(evaluator: Evaluation, node: Call) -> Tensor:
    args = _args(evaluator, node, 1, 2)
    items = args[0].items if len(args) == 1 else args[0].items + args[1].items
    if len(args) == 2 and (args[0].dims or args[1].dims):
        raise ExportError(node.place, f"'{node.name}' expects two scalars or one array")
    if not items:
        raise ExportError(node.place, f"'{node.name}' of an empty array has no value")
    return scalar_tensor(
        reduce(lambda one, other: fold.arithmetic(node.name, (one, other), node.place), items)
    )


def _variable(evaluator: Evaluation, node: Call) -> Tensor:
    """Evaluate the argument of der, pre, edge or change, which must be a variable."""
    value = _args(evaluator, node, 1)[0]
    if not all(isinstance(item, Var) for item in value.items):
        raise ExportError(node.place, f"the argument of '{node.name}' must be a variable")
    return value


def _der(evaluator: Evaluation, node: Call) -> Tensor:
    value = _variable(evaluator, node)
    if value.type != "Real":
        raise ExportError(node.place, "'der' needs a Real")
    return tensor(value.dims, [Der(item.name) for item in value.items if isinstance(item, Var)], "Real")


def _pre(evaluator: Evaluation, node: Call) -> Tensor:
    value = _variable(evaluator, node)
    return tensor(value.dims, [Pre(v.name, v.type) for v in value.items if isinstance(v, Var)], value.type)


def _change(evaluator: Evaluation, node: Call) -> Tensor:
    value = _variable(evaluator, node)
    if value.dims:
        raise ExportError(node.place, f"'{node.name}' needs a scalar")
    item = value.items[0]
    assert isinstance(item, Var)
    if item.type == "Real" or (node.name == "edge" and item.type != "Boolean"):
        raise ExportError(node.place, f"'{node.name}' of {item.type} is not supported")
    before = Pre(item.name, item.type)
    if node.name == "edge":
        return scalar_tensor(Op("and", (item, Op("not", (before,), "Boolean")), "Boolean"))
    return scalar_tensor(Op("<>", (item, before), "Boolean"))


def _ordinal(evaluator: Evaluation, node: Call) -> Tensor:
    """The position of an item in its enumeration, starting at 1."""

    def make(args: tuple[Scalar, ...]) -> Scalar:
        arg = args[0]
        if arg.type not in evaluator.model.enumerations:
            raise ExportError(node.place, f"'Integer' expects an enumeration, not {arg.type}")
        return Lit(arg.value, "Integer") if isinstance(arg, Lit) else Op("ordinal", (arg,), "Integer")

    return _map(evaluator, node, make)


def _without_events(evaluator: Evaluation, node: Call) -> Tensor:
    with evaluator.without_events():
        return _args(evaluator, node, 2 if node.name == "smooth" else 1)[-1]


def _size(evaluator: Evaluation, node: Call) -> Tensor:
    value = evaluator.value(node.arguments[0])
    if len(node.arguments) == 1:
        return tensor((len(value.dims),), [Lit(n, "Integer") for n in value.dims], "Integer")
    index = evaluator.static_integer(node.arguments[1], node.place)
    if not 1 <= index <= len(value.dims):
        raise ExportError(node.place, f"there is no dimension {index}")
    return scalar_tensor(Lit(value.dims[index - 1], "Integer"))


def _fill(evaluator: Evaluation, node: Call) -> Tensor:
    texts = node.arguments
    if node.name == "fill":
        item: Scalar = evaluator.scalar(texts[0])
        texts = texts[1:]
    else:
        item = Lit(0 if node.name == "zeros" else 1, "Integer")
    dims = tuple(evaluator.static_integer(text, node.place) for text in texts)
    return Tensor(dims, (item,) * prod(dims), item.type)


def _identity(evaluator: Evaluation, node: Call) -> Tensor:
    n = evaluator.static_integer(node.arguments[0], node.place)
    return tensor((n, n), [Lit(int(i == j), "Integer") for i in range(n) for j in range(n)], "Integer")


def _reduce(evaluator: Evaluation, node: Call) -> Tensor:
    items = list(_args(evaluator, node, 1)[0].items)
    if node.name == "sum":
        return scalar_tensor(_sum(items, node.place))
    one: Scalar = Lit(1.0, "Real")
    product = reduce(lambda a, b: fold.arithmetic("*", (a, b), node.place), items) if items else one
    return scalar_tensor(product)


def _transpose(evaluator: Evaluation, node: Call) -> Tensor:
    value = _args(evaluator, node, 1)[0]
    if len(value.dims) != 2:
        raise ExportError(node.place, "'transpose' needs a matrix")
    rows, columns = value.dims
    items = [value.items[r * columns + c] for c in range(columns) for r in range(rows)]
    return tensor((columns, rows), items, value.type)


def _cat(evaluator: Evaluation, node: Call) -> Tensor:
    axis = evaluator.static_integer(node.arguments[0], node.place)
    parts = [evaluator.value(text) for text in node.arguments[1:]]
    if axis != 1 or not parts or any(part.dims[1:] != parts[0].dims[1:] or not part.dims for part in parts):
        raise ExportError(
            node.place, "'cat' is only supported along dimension 1, for arrays with equal other sizes"
        )
    dims = (sum(part.dims[0] for part in parts), *parts[0].dims[1:])
    return tensor(dims, [item for part in parts for item in part.items])


def _initial(evaluator: Evaluation, node: Call) -> Tensor:
    return scalar_tensor(Initial())


def _sample(evaluator: Evaluation, node: Call) -> Tensor:
    raise ExportError(
        node.place, "'sample' is only allowed as a condition of 'when', alone or as 'sample(...) and ...'"
    )


_CALLS: dict[str, Known] = {
    "delay": delay,
    "abs": _plain,
    "sign": _plain,
    "floor": _rounding,
    "ceil": _rounding,
    "integer": _rounding,
    "div": _division,
    "mod": _division,
    "rem": _division,
    "min": _extreme,
    "max": _extreme,
    "der": _der,
    "pre": _pre,
    "edge": _change,
    "Integer": _ordinal,
    "change": _change,
    "noEvent": _without_events,
    "smooth": _without_events,
    "size": _size,
    "fill": _fill,
    "zeros": _fill,
    "ones": _fill,
    "identity": _identity,
    "sum": _reduce,
    "product": _reduce,
    "transpose": _transpose,
    "cat": _cat,
    "initial": _initial,
    "sample": _sample,
}


_REFUSED = {
    "terminate": "'terminate' is not supported",
    "terminal": "'terminal' is not supported",
    "spatialDistribution": "'spatialDistribution' is only allowed in '(a, b) = spatialDistribution(...)'",
    "homotopy": "'homotopy' is not supported",
    "semiLinear": "'semiLinear' is not supported",
    "cardinality": "'cardinality' is not supported",
    "String": "'String' is not supported",
    "Connections.branch": "connections are not supported",
}
