"""Problems: a model, a requirement, and what may be varied."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from falsifier.context.values import Context, Named
from falsifier.core.arguments import finite, instance, path_of, texts
from falsifier.core.experiment import Experiment
from falsifier.core.literals import shortest
from falsifier.core.model import Interface, Model, ModelInfo, Variable
from falsifier.core.ranges import number_names
from falsifier.core.space import SearchSpace
from falsifier.core.words import ends
from falsifier.errors import SpecError, did_you_mean, in_section
from falsifier.fmu import System
from falsifier.problem.requirement import Requirement, check_comparable
from falsifier.problem.shorthand import InputChoice, ParameterChoice, changes_from, requirement_of
from falsifier.problem.source import STL_NAME, ProblemSource
from falsifier.stl import Formula

if TYPE_CHECKING:
    from falsifier.problem.joining import Joined


@dataclass(frozen=True, slots=True)
class Held:
    """An input or a parameter of the model that is not searched."""

    name: str
    causality: Literal["input", "parameter"]  # whether it is an input or a parameter
    # The number or text at which it is held; None: the model's own, which it does not state.
    value: float | str | None
    reason: str  # why it is not searched, in words
    item: str = ""  # the name of the value: of an enumeration's item, or true or false of a Boolean


@dataclass(frozen=True, slots=True, repr=False)
class Problem:
    """Everything that ``evaluate`` and an engine need to know; immutable and picklable.

    Attributes:
        model: the model to simulate.
        requirement: the requirement to violate.
        space: what may be varied.
        experiment: how each simulation is run.
        parameters: fixed values of parameters, start values and constant inputs, by name.
        source: how it was loaded, before what was changed since; None if it was made in Python.
        notes: what was chosen or ignored when it was loaded and the user should know, in words.
        named_context: what the user named for a language model or an engine to read; see ``problem.context``.
        context: what was read of it.

    Raises:
        SpecError: if the parts do not fit: the model has no such variable, the formula names a signal that is
            not recorded, or the search space has another stop time than the experiment.
    """

    model: Model
    requirement: Requirement
    space: SearchSpace
    experiment: Experiment
    parameters: Mapping[str, float] = field(default_factory=dict)
    source: ProblemSource | None = None
    notes: tuple[str, ...] = field(default=(), compare=False)
    named_context: Named = field(default_factory=Named)
    context: Context = field(default_factory=Context)

    def __post_init__(self) -> None:
        if self.space.stop_time != self.experiment.stop_time:
            raise SpecError(
                f"{self.name}: stop_time is {self.space.stop_time:.12g} s in the search space, but "
                f"{self.experiment.stop_time:.12g} s in the experiment"
            )
        if self.info.variables:
            _check_variables(self)

    def __repr__(self) -> str:
        return f"<Problem {self.name} of {self.info.name}: {self.requirement.formula}, {self.space!r}>"

    @staticmethod
    def from_fmu(
        fmu: str | Path | System,
        stl: str,
        *,
        name: str = STL_NAME,
        inputs: Mapping[str, InputChoice] | None = None,
        parameters: Mapping[str, ParameterChoice] | None = None,
        stop_time: float | None = None,
        output_interval: float | None = None,
        step_size: float | None = None,
        tolerance: float | None = None,
        time_limit: float | None = None,
        interface: Interface | None = None,
        context: Sequence[str] = (),
        omit: Sequence[str] = (),
        allow: Sequence[str] = (),
        deny: Sequence[str] = (),
    ) -> "Problem":
        """Return the problem for an FMU, an SSP package or a system of FMUs, and a formula.

        Args:
            fmu: path of the FMU or package, or the system, whose variables are ``component.variable``.
            stl: the requirement, in Signal Temporal Logic; or a template with its arguments.
            name: the requirement's name, in results and records.
            inputs: inputs to search or keep constant, by name; see InputChoice. If nothing is to be searched,
                all inputs with a min and a max are, and Booleans and enumerations; none that is connected.
            parameters: values of parameters and start values, or ranges to search, by name.
            stop_time: end of each simulation in s; default: the FMU's.
            output_interval: step of the monitored time grid in s; default: the FMU's step, or the next
                smaller one that fits the stop time and the formula's times.
            step_size: communication step or maximum solver step in s; default: the output interval.
            tolerance: relative tolerance of the solver; default: the FMU's.
            time_limit: maximum wall-clock time of a simulation in s; default: 60 per tenth of simulated time.
            interface: interface of the FMU; default: co-simulation if the FMU offers it. The components of a
                system have interfaces of their own.
            context: files that a language model may read, and ``fmu`` for what lies inside the FMU.
            omit: outputs and internal variables not to record, such as one that becomes NaN.
            allow: what the FMU may do beyond changing its own folders: ``write:PATH``, ``read:PATH`` (a file
                or folder that may hold keys), ``programs`` (execute programs).
            deny: what it may not do: ``network`` (open connections).

        Raises:
            SpecError: naming what is wrong or unknown.
            ModelError: if the FMU cannot be read or simulated.

        >>> Problem.from_fmu("my.fmu", "G[0,10] (h >= 0)", inputs={"u": (-1, 1)})  # doctest: +SKIP
        >>> system = System({"plant": "plant.fmu", "pi": "pi.fmu"}, {"plant.u": "pi.y"})  # doctest: +SKIP
        >>> Problem.from_fmu(system, "G[0,10] (plant.h >= 0)")  # doctest: +SKIP
        """
        from falsifier.problem.joining import join_formula

        changes = changes_from(
            inputs=inputs,
            parameters=parameters,
            stop_time=stop_time,
            output_interval=output_interval,
            step_size=step_size,
            tolerance=tolerance,
            time_limit=time_limit,
            interface=interface,
            omit=omit,
            allow=allow,
            deny=deny,
        )
        context = texts("context", context)
        expected = "the path of an FMU or SSP package, or a System"
        model = fmu if isinstance(fmu, System) else path_of("fmu", fmu, expected)
        problem = Problem.of(join_formula(model, requirement_of(stl), changes=changes, name=name))
        source = None
        if not isinstance(fmu, System):
            source = ProblemSource(target=str(fmu), stl=stl, stl_name=name, changes=changes, context=context)
        return replace(problem, source=source, named_context=Named.of(context))

    @staticmethod
    def of(joined: "Joined") -> "Problem":
        """Return the problem that a spec, or a model and a formula, was joined to."""
        return Problem(**joined._asdict())

    def with_requirement(self, formula: Formula | str, description: str = "") -> "Problem":
        """Return the problem with another formula, of which all signals are recorded."""
        requirement = Requirement(self.name, formula, description)
        inputs = [v.name for v in self.info.inputs]
        more = (name for name in requirement.formula.signals if name not in inputs)
        return replace(self.recording((*self.experiment.outputs, *more)), requirement=requirement)

    def recording(self, names: Iterable[str]) -> "Problem":
        """Return the problem with these variables recorded before its own; its source says so, too."""
        outputs = tuple(dict.fromkeys((*names, *self.experiment.outputs)))
        source = self.source and self.source.model_copy(update={"record": outputs})
        internals = tuple(name for name in self.experiment.internals if name not in outputs)
        experiment = replace(self.experiment, outputs=outputs, internals=internals)
        changed = replace(self, experiment=experiment, source=source)
        return self if outputs == self.experiment.outputs else changed

    def watching(self, internals: Iterable[str], *, only_modes: bool = False) -> "Problem":
        """Return the problem with these internal variables recorded after its own; or with modes alone."""
        watched = tuple(n for n in internals if not only_modes or self.info.kind(n) != "real")
        if not watched:
            return self
        changed = self.recording((*self.experiment.outputs, *watched))
        return replace(changed, experiment=replace(changed.experiment, internals=watched))

    @property
    def internals(self) -> tuple[str, ...]:
        """Internal variables that a search records; none if the formula compares a continuous signal."""
        compared = set(self.requirement.formula.signals).intersection(self.experiment.outputs)
        has_slope = any(v.is_continuous for v in self.info.variables if v.name in compared)
        return () if has_slope else self.experiment.internals

    @property
    def info(self) -> ModelInfo:
        """What is known about the model without simulating it."""
        return self.model.info

    @property
    def held(self) -> tuple[Held, ...]:
        """The model's inputs and parameters that are not searched, with their values and the reason."""
        given: dict[str, float | str] = {**dict(self.experiment.strings), **self.parameters}
        searched = set(self.space.names)
        listed = [*self.info.inputs, *self.info.parameters]
        names = {v.name for v in listed}
        # Start values and elements that are given belong to variables of other kinds.
        listed += [v for v in self.info.variables if v.name in given and v.name not in names]
        return tuple(_held(v, self.info, given) for v in listed if v.name not in searched)

    @property
    def held_inputs(self) -> tuple[Held, ...]:
        """The inputs among them: nobody expects a parameter without a range to be searched."""
        return tuple(held for held in self.held if held.causality == "input")

    @property
    def name(self) -> str:
        """The requirement's name."""
        return self.requirement.name

    @property
    def fingerprint(self) -> str:
        """SHA-256 of all that results depend on; of an FMU alone its name and interface, not its content."""
        content = (
            self.info.name,
            getattr(self.model, "interface", ""),
            getattr(self.model, "key", ""),
            self.name,
            str(self.requirement.formula),
            (self.space.inputs, self.space.parameters),
            self.experiment,
            sorted(self.parameters.items()),
        )
        return sha256(repr(content).encode()).hexdigest()


def _held(v: Variable, info: ModelInfo, given: Mapping[str, float | str]) -> Held:
    value, names = given.get(v.name, v.start), number_names(v.kind, v.items)
    item = names.get(int(value), "") if names and not isinstance(value, str | None) else ""
    reason = _held_because(v, info, is_given=v.name in given)
    return Held(v.name, "input" if v.causality == "input" else "parameter", value, reason, item)


def _held_because(variable: Variable, info: ModelInfo, *, is_given: bool) -> str:
    if is_given:
        return "its value is given"
    if variable.kind == "string":
        return "a text has no range"
    if variable.causality == "input":
        low, high = variable.limits
        if low is None or high is None:
            return f"no range is given, and the {info.noun} specifies no min and max"
        return f"not named beside what is searched; range {' to '.join(ends(low, high))}"
    return "no range is given"


def held_text(held: Iterable[Held]) -> str:
    """Say which inputs and parameters are not searched, by reason; empty if all are.

    >>> held_text([Held("u", "input", 1.0, "its value is given", "on"), Held("v", "input", None, "no range")])
    'u = 1 (on) (its value is given); v (no range)'
    >>> held_text([Held("p", "input", 1000000000500.1, "its value is given")])
    'p = 1000000000500.1 (its value is given)'
    """
    by_reason: dict[str, list[str]] = {}
    for each in held:
        value = each.value if isinstance(each.value, str | None) else shortest(each.value)
        item = f" ({each.item})" if each.item else ""
        said = each.name if value is None else f"{each.name} = {value}{item}"
        by_reason.setdefault(each.reason, []).append(said)
    return "; ".join(f"{', '.join(values)} ({reason})" for reason, values in by_reason.items())


def _check_variables(problem: Problem) -> None:
    """Check that the model has all variables that are named, and that the formula's signals will be known."""
    info, experiment = problem.info, problem.experiment
    known = {v.name for v in info.variables}
    inputs = [v.name for v in info.inputs]
    for name in (r.name for r in problem.space.inputs):
        if name not in inputs:
            raise SpecError(f"{problem.name}: the model has no input {name!r}; {did_you_mean(name, inputs)}")
    for name in (*(p.name for p in problem.space.parameters), *problem.parameters, *experiment.outputs):
        if name not in known:
            near = did_you_mean(name, (v.name for v in info.variables))
            raise SpecError(f"{problem.name}: the model has no variable {name!r}; {near}")
    for each in problem.space.ranges:
        variable = info[each.name]  # of a real one, whole numbers alone may be searched
        is_other = variable.kind != "real" and each.kind == "real"
        items_differ = not each.items or set(each.items) - set(variable.items)
        if is_other or (variable.literals and items_differ):
            items = f", items={variable.items}" if variable.literals else ""
            raise SpecError(
                f"{problem.name}: {each.label} is of type {variable.kind} in the model: give the range "
                f"kind={variable.kind!r}{items}"
            )
    for name, value in problem.parameters.items():
        finite(f"{problem.name}: parameter {name!r}", value)
    for name in problem.requirement.formula.signals:
        if name not in (*experiment.outputs, *inputs):
            raise SpecError(
                f"{problem.name}: the formula names {name!r}, which is neither an input nor recorded: add it "
                "to the experiment's outputs"
            )
        with in_section(problem.name):
            check_comparable(info[name])


def check_limits(problem: Problem) -> None:
    """Check that all values to be tried are within the model's limits; SpecError naming a range."""
    for each in problem.space.ranges:
        if each.name in problem.info and (excess := problem.info[each.name].excess(each.low, each.high)):
            raise SpecError(f"{problem.name}: [{each.low:.12g}, {each.high:.12g}] {excess}; narrow the range")


def check_problem(given: object) -> None:
    """Check that a user gave a problem; SpecError if not."""
    instance("problem", given, Problem, "a Problem, such as load_problem('AT1')")


def check_names(problems: Iterable[Problem]) -> None:
    """Check that no two problems have the same name, by which results go; SpecError naming it."""
    seen: set[str] = set()
    for problem in problems:
        if problem.name in seen:
            raise SpecError(
                f"two of the problems are named {problem.name!r}, and results and records go by the name: "
                "name each differently, with Problem.from_fmu(..., name=...) or Requirement(name, ...)"
            )
        seen.add(problem.name)


def alike(problems: Iterable[Problem]) -> list[list[Problem]]:
    """Group problems that are simulated alike; within a group all record the same signals."""
    groups: list[tuple[object, list[Problem]]] = []
    for problem in problems:
        bare = replace(problem.experiment, outputs=(), internals=())
        simulated = (problem.model, problem.space, bare, problem.parameters)
        group = next((members for other, members in groups if other == simulated), [])
        if not group:
            groups.append((simulated, group))
        group.append(problem)
    return [
        [p.recording(n for q in group for n in q.experiment.outputs) for p in group] for _, group in groups
    ]
