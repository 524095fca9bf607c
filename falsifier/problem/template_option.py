"""Templates on the command line: they become the formula of the problem's own simulation."""

from collections.abc import Mapping
from pathlib import Path

from falsifier.errors import SpecError
from falsifier.problem.joining import join, join_fmu
from falsifier.problem.loading import find_spec
from falsifier.problem.sections import AnyRequirement, ModelChanges
from falsifier.problem.source import ProblemSource
from falsifier.problem.spec import Spec, parse_spec, read_spec
from falsifier.problem.template_arguments import template_arguments

_OPTION = "--template"
# Keys of a requirement in a spec that are no arguments of its template.
_BESIDE = {*ModelChanges.model_fields, "description"}


def formula_of_template(source: ProblemSource, text: str) -> str:
    """Return the text of the formula that a template stands for.

    Args:
        source: the model and its experiment.
        text: name of the template and ``key=value`` for each argument.

    Raises:
        SpecError: naming the argument that is wrong.
        FormulaError: if the text is not of this form.
    """
    arguments = template_arguments(text)
    _check_keys(arguments)
    kind, name = source.parts.kind, _OPTION
    if kind == "python":
        raise SpecError(f"{source.target}: a problem made in Python has its own requirement; drop {_OPTION}")
    try:
        if kind == "fmu":
            joined = join_fmu(Path(source.target), arguments, changes=source.changes, name=name)
        else:
            path, requirement = find_spec(source.target)
            spec = read_spec(path)
            _check_single(spec, requirement, source.target)
            name = requirement or next(iter(spec.requirements))
            spec = _with(spec, name, arguments)
            joined = join(spec, name, path=path, profile=source.profile, changes=source.changes)
    except SpecError as error:
        if error.key is None or not error.key.startswith("requirements."):
            raise
        problem = str(error).partition(f"{error.key}: ")[2]
        argument = error.key.removeprefix(f"requirements.{name}").removeprefix(".")
        raise SpecError(problem, file=_OPTION, key=argument or None) from None
    return str(joined.requirement.formula)


def _check_single(spec: Spec, requirement: str | None, target: str) -> None:
    """Refuse a spec whose requirements change the simulation differently: whose changes hold is not clear."""
    first, *others = (_kept(section) for section in spec.requirements.values())
    if requirement is None and any(changes != first for changes in others):
        names = ", ".join(spec.requirements)
        raise SpecError(
            f"the requirements of {target} simulate in different ways; say whose inputs and times hold: "
            f"{target}:NAME, with one of {names}",
            file=_OPTION,
        )


def _kept(section: AnyRequirement) -> dict[str, object]:
    """Return what a requirement changes of the simulation."""
    return {
        key: getattr(section, key) for key in ModelChanges.model_fields if key in section.model_fields_set
    }


def _check_keys(arguments: Mapping[str, object]) -> None:
    """Refuse what only a section of a spec may have: it would shape the formula and not the simulation."""
    beside = next((key for key in arguments if key in _BESIDE), None)
    if beside is not None:
        raise SpecError(
            "no argument of a template on the command line; simulations are changed by the other options "
            "(--stop-time, --input, --param, ...), or write a spec with [requirements.NAME]",
            file=_OPTION,
            key=beside,
        )


def _with(spec: Spec, name: str, arguments: dict[str, object]) -> Spec:
    """Return the spec with the template in place of a requirement, which keeps what it overrides."""
    section = parse_spec(
        {"model": {"fmu": "-"}, "requirements": {name: arguments}}, file=_OPTION
    ).requirements[name]
    kept = _kept(spec.requirements[name])
    return spec.model_copy(
        update={"requirements": {**spec.requirements, name: section.model_copy(update=kept)}}
    )
