"""Templates on the command line: they become the formula of the problem's own simulation."""

from pathlib import Path

from falsifier.errors import SpecError
from falsifier.problem.joining import join, join_fmu
from falsifier.problem.loading import find_spec
from falsifier.problem.source import ProblemSource
from falsifier.problem.spec import AnyRequirement, ModelChanges, Spec, parse_spec, read_spec
from falsifier.problem.template_arguments import template_arguments

_OPTION = "--template"


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
    kind = source.parts.kind
    if kind == "python":
        raise SpecError(f"{source.target}: a problem made in Python has its own requirement; drop {_OPTION}")
    try:
        if kind == "fmu":
            joined = join_fmu(Path(source.target), arguments, changes=source.changes, name=_OPTION)
        else:
            path, name = find_spec(source.target)
            spec = read_spec(path)
            name = name or next(iter(spec.requirements))
            spec = _with(spec, name, arguments)
            joined = join(spec, name, path=path, profile=source.profile, changes=source.changes)
    except SpecError as error:
        if error.key is None or not error.key.startswith("requirements."):
            raise
        problem = str(error).partition(f"{error.key}: ")[2]
        raise SpecError(problem, file=_OPTION, key=error.key.rpartition(".")[2]) from None
    return str(joined.requirement.formula)


def _with(spec: Spec, name: str, arguments: dict[str, object]) -> Spec:
    """Return the spec with the template in place of a requirement, which keeps what it overrides."""
    section = parse_spec(
        {"model": {"fmu": "-"}, "requirements": {name: arguments}}, file=_OPTION
    ).requirements[name]
    old: AnyRequirement = spec.requirements[name]
    kept = {key: getattr(old, key) for key in ModelChanges.model_fields if key in old.model_fields_set}
    return spec.model_copy(
        update={"requirements": {**spec.requirements, name: section.model_copy(update=kept)}}
    )
