"""Equations, statements, if, for and when of one instance -> scalar equations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from . import fold
from .evaluate import Evaluator, cast, fitted
from .ir import (
    Assert,
    Branch,
    Condition,
    Der,
    Edge,
    Equation,
    Flat,
    FlatModel,
    Initial,
    Lit,
    Op,
    Outputs,
    Pre,
    Reinit,
    Scalar,
    Section,
    Set,
    Statement,
    Tensor,
    Tick,
    Var,
    names_in,
)
from .library import find_class
from .syntax import (
    ArrayOf,
    Assign,
    Body,
    Call,
    Equal,
    ExportError,
    Expr,
    For,
    If,
    Item,
    Operation,
    Place,
    Ref,
    Run,
    Several,
    Text,
    When,
)

TRUE = Lit(True, "Boolean")


def equation(item: Item, here: Evaluator, model: FlatModel) -> None:
    """Add the scalar equations of one equation to the model."""
    match item:
        case Equal(left, right, place):
            _equal(here.value(left), here.value(right), place, model)
        case Several():
            model.equations.append(outputs(item, here))
        case For(index, over, body, place):
            for value in _loop_values(over, here, place):
                inner = _with_index(here, index, value)
                for part in body:
                    equation(part, inner, model)
        case If():
            _if_equation(item, here, model)
        case When():
            _when_equation(item, here, model)
        case Run(call, place) if call.name == "assert":
            model.equations.append(assertion(call, here, TRUE))
        case Run(call, place):
            raise ExportError(place, f"'{call.name}' cannot stand here")
        case _:
            raise ExportError(item.place, "this is not an equation")


def _equal(left: Tensor, right: Tensor, place: Place, model: FlatModel) -> None:
    if left.dims != right.dims:
        raise ExportError(place, f"the sides of '=' have sizes {list(left.dims)} and {list(right.dims)}")
    for a, b in zip(left.items, right.items, strict=True):
        if (a.type == "Boolean") != (b.type == "Boolean"):
            raise ExportError(place, f"'=' between {a.type} and {b.type}")
        for one, other in ((a, b), (b, a)):
            real = other.type == "Real" and not isinstance(other, (Var, Der))
            if isinstance(one, Var) and one.type == "Integer" and real:
                raise ExportError(place, f"the Integer '{one.name}' cannot take a Real; use integer(...)")
        model.equations.append(Equation(a, b, place))


def _loop_values(over: Expr, here: Evaluator, place: Place) -> list[Scalar]:
    values = here.value(over)
    if len(values.dims) != 1:
        raise ExportError(place, "a for loop runs over a range or a vector: 'for i in 1:n loop'")
    return [here.static(item, place) for item in values.items]


def _with_index(here: Evaluator, index: str, value: Scalar) -> Evaluator:
    scope = here.scope.with_local(index, Tensor((), (value,), value.type))
    return here.at(scope, events=here.events, sink=here.sink)


def outputs(item: Several, here: Evaluator) -> Outputs:
    """`(a, b) = f(x)`."""
    if not isinstance(item.right, Call):
        raise ExportError(item.place, "the right side of '(a, b) =' needs to be a function call")
    function = find_class(item.right.name, here.scope.cls, item.place)
    results = here.function_outputs(function, item.right)
    if len(item.left) > len(results):
        raise ExportError(item.place, f"'{function.name}' has {len(results)} outputs, not {len(item.left)}")
    args = here.arguments(function, item.right)
    model = here.model
    model.functions[function.full_name] = function
    made: list[Outputs] = []
    auxiliary = here.at(here.scope, sink=made.append).lifted(function, args, item.place)
    for name in (n for target in made[0].targets if target for n in target):
        del model.variables[name]
    targets: list[tuple[str, ...] | None] = []
    for k, result in enumerate(auxiliary):
        ref = item.left[k] if k < len(item.left) else None
        targets.append(None if ref is None else _target_names(here.value(ref), result, item.place))
    return replace(made[0], targets=tuple(targets))


def _target_names(target: Tensor, result: Tensor, place: Place) -> tuple[str, ...]:
    if target.dims != result.dims or target.type != result.type:
        raise ExportError(
            place, f"{target.type}{list(target.dims)} cannot take {result.type}{list(result.dims)}"
        )
    return tuple(_name(item, place) for item in target.items)


def _name(item: Scalar, place: Place) -> str:
    if not isinstance(item, Var):
        raise ExportError(place, "a variable needs to stand on the left side")
    return item.name


# ------------------------------------------------------------------- if, when


def _if_equation(item: If, here: Evaluator, model: FlatModel) -> None:
    pending: list[tuple[Scalar, Body]] = []
    otherwise = item.otherwise
    for text, body in item.branches:
        condition = here.scalar(text)
        if isinstance(condition, Lit):
            if condition.value:
                otherwise = body
                break
            continue
        pending.append((condition, body))
    if not pending:
        for part in otherwise:
            equation(part, here, model)
        return
    cases = [(condition, _branch_equations(body, here, model)) for condition, body in pending]
    last = _branch_equations(otherwise, here, model)
    for target in dict.fromkeys(key for _, found in [*cases, (TRUE, last)] for key in found):
        if target not in last or any(target not in found for _, found in cases):
            raise ExportError(
                item.place, f"every branch of an if-equation needs an equation '{target} = ...'"
            )
        value = last[target].right
        for condition, found in reversed(cases):
            value = fold.choose(condition, found[target].right, value, item.place)
        model.equations.append(Equation(last[target].left, value, item.place))


def _no_when(body: Body) -> None:
    for item in body:
        if isinstance(item, When):
            raise ExportError(item.place, "'when' inside of 'if' is not supported; put the condition into the when clause")


def _branch_equations(body: Body, here: Evaluator, model: FlatModel) -> dict[str, Equation]:
    """The equations of one branch by the variable or derivative on their left side."""
    _no_when(body)
    before = len(model.equations)
    for part in body:
        equation(part, here, model)
    made, found = model.equations[before:], {}
    del model.equations[before:]
    for item in made:
        if isinstance(item, Equation) and isinstance(item.left, (Var, Der)):
            key = item.left.name if isinstance(item.left, Var) else f"der({item.left.name})"
            found[key] = item
        elif isinstance(item, Outputs) and all(t and t[0].startswith("$call") for t in item.targets):
            model.equations.append(item)
        else:
            raise ExportError(
                item.place, "an equation inside of 'if' needs the form 'x = ...' or 'der(x) = ...'"
            )
    return found


def when_condition(text: Expr, here: Evaluator, model: FlatModel, add: Callable[[Condition], None]) -> Scalar:
    """The condition of a when clause as 'has become true just now'."""
    if isinstance(text, ArrayOf):
        result = when_condition(text.elements[0], here, model, add)
        for element in text.elements[1:]:
            other = when_condition(element, here, model, add)
            result = fold.logic("or", (result, other), text.place)
        return result
    if isinstance(text, Call) and text.name == "sample":
        return _tick(text, here)
    if isinstance(text, Operation) and text.operator == "and":
        first, second = text.operands
        if isinstance(first, Call) and first.name == "sample":
            with here.without_events():
                return fold.logic("and", (_tick(first, here), here.scalar(second)), text.place)
    value = here.scalar(text)
    if value.type != "Boolean":
        raise ExportError(text.place, "the condition of 'when' needs to be Boolean")
    if isinstance(value, Initial):
        return value
    model.conditions += 1
    add(Condition(model.conditions, value, text.place))
    return Edge(model.conditions)


def _tick(call: Call, here: Evaluator) -> Tick:
    if len(call.arguments) != 2 or call.named:
        raise ExportError(call.place, "'sample' takes two arguments: sample(start, interval)")
    start, interval = (cast(here.scalar(text), "Real", call.place) for text in call.arguments)
    for value in (start, interval):
        if not _parametric(value, here):
            raise ExportError(call.place, "the arguments of 'sample' need to be parameters or literals")
    return Tick(start, interval)


def _parametric(value: Scalar, here: Evaluator) -> bool:
    match value:
        case Lit():
            return True
        case Var(name, _):
            return name in here.leaves and here.leaves[name][0].variability in ("parameter", "constant")
        case Op(_, args, _):
            return all(_parametric(arg, here) for arg in args)
    return False


def _when_equation(item: When, here: Evaluator, model: FlatModel) -> None:
    cases: list[tuple[Scalar, dict[str, Equation]]] = []
    earlier: Scalar = Lit(False, "Boolean")
    for text, body in item.branches:
        edge = when_condition(text, here, model, model.equations.append)
        guard = fold.logic("and", (edge, fold.logic("not", (earlier,), item.place)), item.place)
        with here.without_events():
            cases.append((edge, _when_body(body, guard, here, model)))
        earlier = fold.logic("or", (earlier, edge), item.place)
    targets = dict.fromkeys(key for _, found in cases for key in found)
    for target in targets:
        if any(found and target not in found for _, found in cases):
            raise ExportError(item.place, f"every branch of this when clause needs to set '{target}'")
        variable = model.variables[target]
        value: Scalar = Pre(target, variable.type)
        for edge, found in reversed(cases):
            if target in found:
                value = fold.choose(edge, found[target].right, value, item.place)
        model.equations.append(Equation(Var(target, variable.type), value, item.place, discrete=True))


def _when_body(body: Body, guard: Scalar, here: Evaluator, model: FlatModel) -> dict[str, Equation]:
    """The variables set in a when clause; reinit and assert go to the model with their guard."""
    found: dict[str, Equation] = {}
    for item in body:
        match item:
            case Equal(left, right, place):
                target, value = here.value(left), here.value(right)
                value = fitted(value, target.dims, target.type, place)
                for one, other in zip(target.items, value.items, strict=True):
                    found[_name(one, place)] = Equation(one, other, place, discrete=True)
            case Several(place=place):
                raise ExportError(
                    place,
                    "a function with several outputs in a when equation is not supported; "
                    "use an algorithm section",
                )
            case For(index, over, inner, place):
                for value_ in _loop_values(over, here, place):
                    found |= _when_body(inner, guard, _with_index(here, index, value_), model)
            case If():
                found |= _when_if(item, guard, here, model)
            case Run(call, place) if call.name == "reinit":
                model.equations.extend(reinit(call, here, guard))
            case Run(call, place) if call.name == "assert":
                model.equations.append(assertion(call, here, guard))
            case Run(call, place):
                raise ExportError(place, f"'{call.name}' cannot stand in a when clause")
            case _:
                raise ExportError(item.place, "this cannot stand in a when clause")
    return found


def _when_if(item: If, guard: Scalar, here: Evaluator, model: FlatModel) -> dict[str, Equation]:
    cases: list[tuple[Scalar, dict[str, Equation]]] = []
    remaining = guard
    for text, body in item.branches:
        condition = here.scalar(text)
        inner = fold.logic("and", (remaining, condition), item.place)
        cases.append((condition, _when_body(body, inner, here, model)))
        remaining = fold.logic("and", (remaining, fold.logic("not", (condition,), item.place)), item.place)
    last = _when_body(item.otherwise, remaining, here, model)
    result = {}
    for target in dict.fromkeys(key for _, found in [*cases, (TRUE, last)] for key in found):
        if target not in last or any(target not in found for _, found in cases):
            raise ExportError(item.place, f"every branch of 'if' in a when clause needs to set '{target}'")
        value = last[target].right
        for condition, found in reversed(cases):
            value = fold.choose(condition, found[target].right, value, item.place)
        result[target] = Equation(last[target].left, value, item.place, discrete=True)
    return result


def reinit(call: Call, here: Evaluator, guard: Scalar) -> list[Reinit]:
    """`reinit(x, value)`."""
    if len(call.arguments) != 2:
        raise ExportError(call.place, "'reinit' takes two arguments: reinit(state, value)")
    target, value = (here.value(text) for text in call.arguments)
    value = fitted(value, target.dims, "Real", call.place)
    pairs = zip(target.items, value.items, strict=True)
    return [Reinit(_name(one, call.place), guard, other, call.place) for one, other in pairs]


def assertion(call: Call, here: Evaluator, guard: Scalar) -> Assert:
    """`assert(condition, message)`."""
    if len(call.arguments) < 2 or not isinstance(call.arguments[1], Text):
        raise ExportError(call.place, "'assert' needs a condition and a literal message")
    with here.without_events():
        condition = here.scalar(call.arguments[0])
    if guard is not TRUE:
        condition = fold.logic("or", (fold.logic("not", (guard,), call.place), condition), call.place)
    return Assert(condition, call.arguments[1].value, call.place)


# ------------------------------------------------------------------- algorithms


def section(body: Body, place: Place, here: Evaluator, model: FlatModel) -> None:
    """Add an algorithm section to the model."""
    flat: Flat = Section(tuple(statements(body, here, model, TRUE)), place)
    model.equations.append(flat)


def statements(body: Body, here: Evaluator, model: FlatModel, guard: Scalar) -> list[Statement]:
    """Statements with loops unrolled."""
    made: list[Statement] = []
    local = here.at(here.scope, events=here.events, sink=made.append)
    for item in body:
        _statement(item, local, model, made, guard)
    return made


def _statement(item: Item, here: Evaluator, model: FlatModel, made: list[Statement], guard: Scalar) -> None:
    match item:
        case Assign(left, right, place):
            target = _assignable(left, here)
            value = fitted(here.value(right), target.dims, target.type, place)
            made.extend(_sets(target, value, place, model))
        case Several():
            made.append(outputs(item, here))
        case For(index, over, body, place):
            for value_ in _loop_values(over, here, place):
                made.extend(statements(body, _with_index(here, index, value_), model, guard))
        case If(branches, otherwise, place):
            cases = []
            _no_when(otherwise)
            for text, body in branches:
                _no_when(body)
                condition = here.scalar(text)
                cases.append((condition, tuple(statements(body, here, model, guard))))
            made.append(Branch(tuple(cases), tuple(statements(otherwise, here, model, guard)), place))
        case When(branches, place):
            conditions = [when_condition(text, here, model, made.append) for text, _ in branches]
            cases = []
            with here.without_events():
                for edge, (_, body) in zip(conditions, branches, strict=True):
                    cases.append((edge, tuple(statements(body, here, model, guard))))
            made.append(Branch(tuple(cases), (), place))
        case Run(call, place) if call.name == "reinit":
            made.extend(reinit(call, here, TRUE))
        case Run(call, place) if call.name == "assert":
            made.append(assertion(call, here, TRUE))
        case Run(call, place):
            raise ExportError(place, f"a call of '{call.name}' as a statement is not supported")
        case _:
            raise ExportError(
                item.place, "'while', 'break' and 'return' are only supported inside of functions"
            )


def _assignable(ref: Ref, here: Evaluator) -> Tensor:
    target = here.value(ref)
    for item in target.items:
        if not isinstance(item, Var):
            raise ExportError(
                ref.place, f"'{ref}' cannot be assigned (its subscripts need to be known before simulation)"
            )
    return target


def _sets(target: Tensor, value: Tensor, place: Place, model: FlatModel) -> list[Statement]:
    """Element by element; through copies where an element is still read after it has been set."""
    names = [_name(item, place) for item in target.items]
    values = list(value.items)
    made: list[Statement] = []
    if len(names) > 1 and any(set(names) & names_in(item) for item in values):
        start = sum(name.startswith("$copy") for name in model.variables)
        for k, (name, item) in enumerate(zip(names, values, strict=True)):
            copy = replace(model.variables[name], name=f"$copy{start + k}", causality="local", public=False)
            model.variables[copy.name] = copy
            made.append(Set(copy.name, item, place))
            values[k] = Var(copy.name, copy.type)
    return made + [Set(name, item, place) for name, item in zip(names, values, strict=True)]
