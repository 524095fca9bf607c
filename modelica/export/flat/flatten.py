"""A class -> a flat model: variables with attributes, scalar equations."""

from __future__ import annotations

from ..read.library import absolute
from ..read.syntax import Class, ExportError, Expr, Modifier, Number, Operation, Place, Text, Truth
from .algorithms import section
from .equations import equation
from .evaluate import Evaluator
from .instance import Leaf, Mods, Node, NodeArray, Scope
from .ir import Equation, FlatModel, Lit, Pre, Tensor, Type, Var, Variable
from .tensors import fitted

SOLVER_SETTINGS = {
    "method": ("fixed", "adaptive", "implicit"),
    "step": None,
    "maxStep": None,
    "checks": None,
    "delayPoints": None,
    "repeatTicks": ("never", "unseen", "always"),
}
"""Names of solver settings with their allowed words; None means a number."""


def flatten(root: Class, name: str) -> FlatModel:
    """Flatten the model with this full name.

    Raises:
        ExportError: with the file and line of what is wrong or not supported.
    """
    cls = absolute(name, root)
    if cls is None:
        raise ExportError(None, f"there is no model '{name}'")
    if cls.kind not in ("model", "block", "class"):
        raise ExportError(cls.place, f"'{name}' is a {cls.kind}, not a model")
    model = FlatModel(name, cls.description)
    evaluator = Evaluator(model, Scope(None, cls))
    top = Node(cls, "", Mods(), evaluator)
    evaluator.scope = Scope(top, cls)
    leaves = list(_leaves(top))
    for leaf in leaves:
        _declare(leaf, evaluator, model)
    _bodies(top, evaluator, model)
    _experiment(cls, model)
    return model


def _leaves(node: Node) -> list[Leaf]:
    found = []
    for child in node.children():
        match child:
            case Leaf():
                found.append(child)
            case Node():
                found.extend(_leaves(child))
            case NodeArray(_, nodes):
                for item in nodes:
                    found.extend(_leaves(item))
    return found


def _declare(leaf: Leaf, evaluator: Evaluator, model: FlatModel) -> None:
    if leaf.variability == "constant" and all(isinstance(i, Lit) for i in evaluator.leaf(leaf).items):
        return
    place = leaf.component.place
    parametric = leaf.variability in ("parameter", "constant")
    binding = evaluator.binding(leaf).items if parametric else None
    starts = _attribute(leaf, "start", leaf.type, evaluator)
    lowest = Lit(1, leaf.type) if leaf.type in model.enumerations else None
    numbers = {key: _attribute(leaf, key, leaf.type, evaluator) for key in ("min", "max", "nominal")}
    texts = {key: _text(leaf, key) for key in ("unit", "displayUnit", "quantity")}
    fixed = _attribute(leaf, "fixed", "Boolean", evaluator)
    discrete = leaf.variability == "discrete" or leaf.type != "Real"
    if parametric and fixed and not all(evaluator.static(item, place).value for item in fixed.items):
        raise ExportError(
            place, f"the parameter '{leaf.name}' needs a value: 'fixed = false' is not supported"
        )
    if leaf.causality == "input" and not leaf.public:
        raise ExportError(place, f"the input '{leaf.name}' is protected and could never be set")
    for k, name in enumerate(leaf.scalars()):
        known = {
            key: evaluator.static(value.items[k], place).value if value else None
            for key, value in numbers.items()
        }
        model.variables[name] = Variable(
            name=name,
            type=leaf.type,
            variability="parameter" if parametric else "discrete" if discrete else "continuous",
            causality=leaf.causality or "local",  # type: ignore[arg-type]
            public=leaf.public and leaf.variability != "constant",
            final=leaf.component.final or leaf.mods.final or leaf.variability == "constant",
            place=place,
            description=leaf.description,
            unit=texts["unit"],
            display_unit=texts["displayUnit"],
            quantity=texts["quantity"],
            minimum=known["min"],
            maximum=known["max"],
            nominal=known["nominal"],
            fixed=bool(fixed and evaluator.static(fixed.items[k], place).value),
            start=starts.items[k] if starts else lowest,
            binding=binding[k] if binding else None,
        )


def _attribute(leaf: Leaf, name: str, kind: Type, evaluator: Evaluator) -> Tensor | None:
    mod = leaf.mods.inner.get(name)
    if mod is None or mod.value is None:
        return None
    return fitted(evaluator.bound(mod.value), leaf.dims, kind, mod.value.place)


def _text(leaf: Leaf, name: str) -> str | None:
    mod = leaf.mods.inner.get(name)
    if mod is None or mod.value is None:
        return None
    if not isinstance(mod.value.expr, Text):
        raise ExportError(mod.value.place, f"'{name}' must be a string")
    return mod.value.expr.value or None


def _bodies(node: Node, evaluator: Evaluator, model: FlatModel) -> None:
    """Add the declaration equations, equations and algorithms of an instance and of all below it."""
    for child in node.children():
        match child:
            case Leaf():
                _declaration_equation(child, evaluator, model)
            case Node():
                _bodies(child, evaluator, model)
            case NodeArray(_, nodes):
                for inner in nodes:
                    _bodies(inner, evaluator, model)
    for cls in node.classes:
        here = evaluator.at(Scope(node, cls), events=True, sink=model.equations.append)
        for item in cls.equations:
            equation(item, here, model)
        for statements, place in cls.algorithms:
            section(statements, place, here, model)
        quiet = evaluator.at(Scope(node, cls), sink=None)
        for item in cls.initial_equations:
            before = len(model.equations)
            equation(item, quiet, model)
            for made in model.equations[before:]:
                model.initial_equations.append(_initial_equation(made, model))
            del model.equations[before:]


def _declaration_equation(leaf: Leaf, evaluator: Evaluator, model: FlatModel) -> None:
    if leaf.variability in ("parameter", "constant") or leaf.mods.value is None:
        return
    bound = leaf.mods.value
    if leaf.causality == "input":
        raise ExportError(
            bound.place, f"the input '{leaf.name}' cannot have an equation; give it a start value"
        )
    if bound.indices:
        value = evaluator.bound(bound)
    else:
        value = evaluator.at(bound.scope, events=True, sink=model.equations.append).value(bound.expr)
    value = fitted(value, leaf.dims, leaf.type, bound.place)
    for name, item in zip(leaf.scalars(), value.items, strict=True):
        model.equations.append(Equation(Var(name, leaf.type), item, bound.place))


def _initial_equation(made: object, model: FlatModel) -> Equation:
    if not isinstance(made, Equation):
        raise ExportError(getattr(made, "place", None), "an initial equation must have the form 'x = ...'")
    for one, other in ((made.left, made.right), (made.right, made.left)):
        if isinstance(one, (Var, Pre)) and model.variables[one.name].variability != "parameter":
            return Equation(Var(one.name, one.type), other, made.place)
    raise ExportError(made.place, "an initial equation must have the form 'x = ...' with a variable x")


def _experiment(cls: Class, model: FlatModel) -> None:
    settings = {name: mod for name, mod in cls.annotation.inner}
    experiment = dict(settings.get("experiment", Modifier()).inner)
    if _number(experiment, "StartTime"):
        raise ExportError(experiment["StartTime"].place, "'StartTime' must be 0")
    model.stop_time = _number(experiment, "StopTime")
    model.interval = _number(experiment, "Interval")
    model.tolerance = _number(experiment, "Tolerance")
    for name, mod in settings.get("__falsifier_solver", Modifier()).inner:
        if name not in SOLVER_SETTINGS:
            raise ExportError(
                mod.place, f"unknown solver setting '{name}'; expected one of {', '.join(SOLVER_SETTINGS)}"
            )
        value = _literal(mod.value, mod.place)
        words = SOLVER_SETTINGS[name]
        whole = name in ("checks", "delayPoints")
        positive = not isinstance(value, (str, bool)) and value > 0 and not (whole and value % 1)
        if value not in words if words else not positive:
            number = f"a {'whole ' * whole}number above 0"
            allowed = f"one of {', '.join(words)}" if words else number
            raise ExportError(mod.place, f"'{name}' must be {allowed}")
        model.solver[name] = value
    fixed = model.solver.get("method", "adaptive") == "fixed"
    if unused := {"step", "maxStep"} & set(model.solver) - {"step" if fixed else "maxStep"}:
        place = settings["__falsifier_solver"].place
        raise ExportError(
            place, f"'{unused.pop()}' has no effect with this method: 'step' is for \"fixed\" only"
        )


def _number(settings: dict[str, Modifier], name: str) -> float | None:
    if name not in settings:
        return None
    value = _literal(settings[name].value, settings[name].place)
    if isinstance(value, (bool, str)):
        raise ExportError(settings[name].place, f"'{name}' must be a number")
    return float(value)


def _literal(value: Expr | None, place: Place | None) -> float | str | bool:
    match value:
        case Number(number, _) | Truth(number, _) | Text(number, _):
            return number
        case Operation("/", (Number(a, _), Number(b, _)), _):
            return a / b
    raise ExportError(place, "this setting must be a literal value")
