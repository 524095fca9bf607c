"""Requirements: named formulas, checked against a model and an experiment."""

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass

from falsifier.core.arguments import instance
from falsifier.core.experiment import Experiment
from falsifier.core.literals import one_line
from falsifier.core.model import ModelInfo, Variable
from falsifier.errors import FormulaError, SpecError, did_you_mean, in_section, setting
from falsifier.problem.grid import fitting_interval
from falsifier.problem.spec import NAME_IN_LINES, AnyRequirement
from falsifier.problem.template_arguments import Template
from falsifier.stl import Formula, Monitor, parse
from falsifier.stl.expression import Name
from falsifier.stl.formula import Bare, Flag, replaced
from falsifier.stl.lexer import name_text

# What a starter spec has in place of a number; a model's own variable of this name goes before it.
PLACEHOLDER = "LIMIT"


@dataclass(frozen=True, slots=True, init=False, repr=False)
class Requirement:
    """A named STL formula over the model's signals.

    Attributes:
        name: its name in the spec, e.g. ``AT1``.
        formula: the formula, given as text or parsed; ``str(formula)`` is its text.
        description: its meaning in words.

    Raises:
        SpecError: if the name is no text of one line, the description no text, or the formula no formula.
        FormulaError: with the position, if the text of the formula cannot be parsed.

    >>> Requirement("low", "G[0,10] (h >= 0)")
    Requirement('low', 'G[0,10] (h >= 0)')
    """

    name: str
    formula: Formula
    description: str = ""

    def __init__(self, name: str, formula: Formula | str, description: str = "") -> None:
        parsed = parse(formula) if isinstance(formula, str) else formula
        for attribute, value in (("name", name), ("formula", parsed), ("description", description)):
            object.__setattr__(self, attribute, value)
        if not isinstance(self.name, str) or not self.name.strip():
            raise SpecError(f"requirement: expected a name, got {self.name!r}")
        if one_line(self.name) != self.name:  # it stands in messages, tables and titles
            raise SpecError(f"requirement {self.name!r}: {NAME_IN_LINES}")
        instance(f"requirement {self.name!r}: description", self.description, str, "text")
        if not isinstance(self.formula, Formula):
            raise SpecError(f"requirement {self.name!r}: expected a formula or its text, got {formula!r}")

    def __repr__(self) -> str:
        description = f", {self.description!r}" if self.description else ""
        return f"Requirement({self.name!r}, {str(self.formula)!r}{description})"


def parse_requirement(text: str, info: ModelInfo, experiment: Experiment) -> Formula:
    """Parse a formula and check its signals and windows against a model and an experiment.

    Raises:
        SpecError: naming the position of a syntax error, the unknown signal, or what the stop time cuts off.
    """
    try:
        formula = parse(text)
    except FormulaError as error:
        raise SpecError(str(error)) from None
    for name in formula.signals:
        if name == PLACEHOLDER and name not in info:
            raise SpecError(
                f"{name} is a placeholder: write the number, or your requirement in place of this one"
            )
        if name not in info:
            raise SpecError(_unknown(name, info))
        check_comparable(info[name])
    # One input has one name, whose values are known at every sample without asking the model.
    variables = [info[name] for name in formula.signals]
    numbers = [Flag.of(Name(v.name)) for v in variables if v.kind != "boolean" and v.limits != (0.0, 1.0)]
    formula = replaced(formula, {flag: Bare(flag.operator, *flag.sides) for flag in numbers})
    aliases = [v for v in variables if v.alias_of and v.causality == "input"]
    formula = replaced(formula, {Name(v.name): Name(v.alias_of) for v in aliases})
    try:
        Monitor(formula, step=experiment.output_interval, samples=experiment.samples)
    except FormulaError as error:
        steps = {"internal_step": info.internal_step, "step_size": experiment.step_size}
        fits = fitting_interval(formula, experiment.stop_time, fmu_step=experiment.output_interval, **steps)
        is_other = fits is not None and fits != experiment.output_interval
        advice = f"; {setting('output_interval', f'{fits:.12g}')} fits all times" if is_other else ""
        raise SpecError(f"{error}{advice}") from None
    return formula


def check_comparable(variable: Variable) -> None:
    """Check that a simulation gives a variable values that formulas can compare; SpecError if not."""
    if variable.kind == "string":
        raise SpecError(f"{variable.name!r} is a string; only numbers can be recorded and compared")
    if variable.is_clocked:
        raise SpecError(
            f"{variable.name!r} changes only when a clock ticks, which is not simulated here; name a "
            "variable without a clock, or export the model without this one"
        )


def section_formulas(sections: Iterable[AnyRequirement], stop_time: float) -> list[Formula]:
    """Return the formulas of requirements, for the times in them; what is wrong has none."""
    found = []
    for section in sections:
        with suppress(SpecError, FormulaError):
            found.append(parse(section.expanded(section.stop_time or stop_time)))
    return found


def formula_of(section: AnyRequirement, info: ModelInfo, experiment: Experiment, *, key: str) -> Formula:
    """Return the formula of a requirement, checked against a model and an experiment.

    ``key`` is the section's key in its spec; empty if it was given by an option.

    Raises:
        SpecError: naming what is wrong with the formula, or with the arguments of a template.
    """
    kind = "template" if isinstance(section, Template) else "formula"
    option = None if key else setting("stl")
    with in_section(option, key):
        text = section.expanded(experiment.stop_time, experiment.output_interval)
    with in_section(option, key and f"{key}.{kind}"):
        return parse_requirement(text, info, experiment)


def _unknown(name: str, info: ModelInfo) -> str:
    """Say that a signal is unknown: an item's number, or the most similar one and what is usually named."""
    word = name.strip("'")
    if word in info:
        return f"unknown signal {name}: single quotes would be part of its name; write {name_text(word)}"
    item = word.rpartition(".")[2]  # also of Mode.Run, unless the model has a component of this name
    prefix = word.removesuffix(item) or f"{name}."
    named = [v for v in info.variables if item in v.literals]
    if named and not any(v.name.startswith(prefix) for v in info.variables):
        items = [f"{item} is {v.literals[item]} of {v.name}" for v in named]
        told = ", ".join(items[:3])
        return f"unknown signal {name!r}; formulas name items of enumerations by their numbers: {told}"
    if name in ("time", "t"):
        return f"unknown signal {name!r}; times are stated by windows: G[3,5] (x <= 1) says from 3 to 5 s"
    # What a reader left out of a model says what to write instead.
    if told := next((note for note in info.notes if note.startswith(f"the output {name} of ")), ""):
        return f"unknown signal {name!r}; {told}"
    usual = [v.name for v in (*info.observables, *info.inputs) if v.kind != "string"]
    listing = did_you_mean(name, usual)
    near = did_you_mean(name, (v.name for v in info.variables))
    if listing.startswith("known") and not near.startswith("known"):
        listing = f"{near.split('?')[0]}? K{listing[1:]}"
    if name.startswith("der("):
        parts = name[4:-1].split(".")  # components of a system have derivatives of their own
        ends = (f"{'.'.join(parts[:i])}.der({'.'.join(parts[i:])})" for i in range(1, len(parts)))
        if own := next((each for each in ends if each in info), ""):
            return f"unknown signal {name!r}; did you mean {own!r}?"
        listing += "; without a signal that is the rate, use the template ramp_limit and state over and range"
    return f"unknown signal {name!r}; {listing}"
