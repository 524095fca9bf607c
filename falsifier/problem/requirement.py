"""Requirements: named formulas, checked against a model and an experiment."""

from dataclasses import dataclass

from falsifier.core.model import Experiment, ModelInfo
from falsifier.errors import FormulaError, SpecError, did_you_mean
from falsifier.stl import Formula, Monitor, parse


@dataclass(frozen=True, slots=True)
class Requirement:
    """A named STL formula over the model's signals.

    Attributes:
        name: its name in the spec, e.g. ``AT1``.
        formula: the parsed formula; ``str(formula)`` is its text.
        description: its meaning in words.
    """

    name: str
    formula: Formula
    description: str = ""


def parse_requirement(
    text: str, info: ModelInfo, experiment: Experiment, *, file: str | None = None, key: str | None = None
) -> Formula:
    """Parse a formula and check its signals and windows against a model and an experiment.

    Raises:
        SpecError: naming the file and key, and the position of a syntax error, the unknown signal, or the
            window that extends past the stop time.
    """
    try:
        formula = parse(text)
        for name in formula.signals:
            if name not in info:
                known = [v.name for v in (*info.outputs, *info.inputs)]
                raise FormulaError(f"unknown signal {name!r}; {did_you_mean(name, known)}")
        Monitor(formula, step=experiment.output_interval, samples=experiment.samples)
    except FormulaError as error:
        raise SpecError(str(error), file=file, key=key) from None
    return formula
