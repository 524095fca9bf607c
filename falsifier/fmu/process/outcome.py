"""What a worker's replies, and its end, mean in words."""

from collections.abc import Mapping, Sequence

from falsifier.core.words import readable
from falsifier.errors import FailureStatus, FalsifierError, ModelError, OutputError, SimulationError, written
from falsifier.fmu.process.connection import Reply, Where
from falsifier.fmu.process.network import Member, Network
from falsifier.fmu.process.plan import Plan

_STATUS_NAMES = ("ok", "warning", "discard", "error", "fatal")
_PENDING = 5
# What the system as a whole fails in, not the component that was looked at last.
_OF_ALL = (Where.UNSETTLED, Where.NOT_CONVERGED, Where.TIMEOUT)
_BEFORE = "at {reached}, before the stop time {stop}"
_EVENT = f"the event iteration {{returned}} {_BEFORE}"
_FIRST_STEP = "the first step, of {step} s, {returned}{remedy}"
_TEXTS: Mapping[int, str] = {
    Where.SETTING: f"setting the inputs {{returned}} {_BEFORE}",
    Where.STEPPING: f"the step {{returned}} {_BEFORE}",
    Where.GETTING: f"reading the outputs {{returned}} {_BEFORE}",
    Where.EVENT: _EVENT,
    Where.TERMINATED: f"the FMU terminated the simulation {_BEFORE}; a shorter stop_time can be judged",
    Where.STUCK: f"the FMU makes no progress: its events never end {_BEFORE}",
    Where.TOO_SMALL: (
        "no step is small enough: the derivatives are NaN, infinite or discarded, or change too fast "
        f"{_BEFORE}"
    ),
    Where.RESTORING: f"saving or restoring the state {{returned}} {_BEFORE}",
    Where.NOT_A_NUMBER: f"{{outputs}} became nan {_BEFORE}",
    Where.MISSING_AT_FIRST: "{outputs} is nan at t = 0 s, in the initialisation",
    Where.MISSING_AFTER_START: "{outputs} is nan at t = 0 s, after the initialisation",
    Where.UNSETTLED: (
        "the initialisation does not converge: after {rounds} rounds through the connections, these still "
        "change: {changes}; they depend on each other in a loop: give a component other start values or a "
        "delay, or raise coupling.max_rounds or coupling.tolerance"
    ),
    Where.NOT_CONVERGED: (
        "the loop of {loop} does not converge at {reached}: after {rounds} rounds, these still change: "
        "{changes}; raise coupling.max_rounds or coupling.tolerance, or accept a delay of one communication "
        'step: loops = "delay"'
    ),
    Where.CALLING: "{text} {returned} at the start of the simulation",
    Where.WRITING: "setting the {text} {returned}",
    Where.TEXT: "setting {string} {returned}",
    Where.CANNOT_RENEW: "{text}",
    Where.IMPOSSIBLE: "{text}",
    Where.TIMEOUT: "stopped at {reached} {out_of_time}",
}
# The last messages that an error tells.
_SHOWN_LINES = 3


def failure(
    network: Network, plan: Plan, reply: Reply, refusals: str, log: tuple[str, ...]
) -> FalsifierError:
    """Return the error for a simulation that did not reach its stop time.

    A worker may reply anything. The refusals, of what FMUs tried and may not, end the message.
    """
    component = "" if reply.where in _OF_ALL else network.stepped(reply.component)
    words, member = reply.text.split(), network.members[_member(network, reply)]
    step = member.step or plan.times[1] / plan.every
    loops = (range(first, last) for first, last in network.loops)
    together = next((loop for loop in loops if reply.component in loop), ())
    text = _TEXTS.get(reply.where, _EVENT)
    is_first = reply.where == Where.STEPPING and reply.time == 0.0 and reply.status != _PENDING
    if is_first and member.interface == "co-simulation":
        text = _FIRST_STEP
    said = text.format(
        text=reply.text,
        returned=f"returned {_status_name(reply.status)}",
        reached=f"t = {readable(reply.time)} s",
        stop=f"{readable(plan.experiment.stop_time)} s",
        step=f"{step:.6g}",
        remedy=_other_step(member, step, log),
        out_of_time=_out_of_time(plan),
        string=_string(network, plan, reply),
        outputs=", ".join(_titles(network, words)),
        loop=", ".join(sorted(map(network.stepped, together))),
        changes=_changes(network, words),
        rounds=network.coupling.max_rounds,
    )
    text = f"{component or plan.model}: {said}{refusals}"
    if reply.where == Where.IMPOSSIBLE:
        return ModelError(text)
    status: FailureStatus = "timeout" if reply.where == Where.TIMEOUT else "failed"
    time = None if reply.time < 0 else reply.time
    kind = OutputError if reply.where == Where.GETTING else SimulationError
    return kind(text + last_lines(log), status=status, time=time, log=log)


def overdue(plan: Plan, reached: float, during: str, log: tuple[str, ...]) -> SimulationError:
    """Return the error for a simulation whose process was ended because it did not return in time."""
    at, time = _reached(plan, reached)
    return SimulationError(
        f"{plan.model}: did not return{at}{during} and was stopped {_out_of_time(plan)}{last_lines(log)}",
        status="timeout",
        time=time,
        log=log,
    )


def crash(plan: Plan, reached: float, what: str, details: str, log: tuple[str, ...]) -> SimulationError:
    """Return the error for a simulation that its process did not survive."""
    at, time = _reached(plan, reached)
    text = f"{plan.model}: {what}{at}{details}{last_lines(log)}"
    return SimulationError(text, status="crashed", time=time, log=log)


def _reached(plan: Plan, time: float) -> tuple[str, float | None]:
    """Return how far a simulation came, in words and in s, as its process says: it may be any number."""
    if not 0.0 < time < plan.experiment.stop_time * (1.0 + 1e-9):
        return "", None
    return f" at t = {readable(time)} s", time


def last_lines(log: tuple[str, ...]) -> str:
    """Return the end of an error message: the FMU's last messages, from the first about a panic of Rust."""
    lines = tuple(dict.fromkeys(line for line in log if line.strip()))
    panics = [k for k, line in enumerate(lines) if " panicked at " in line]
    lines = lines[panics[0] :][:_SHOWN_LINES] if panics else lines[-_SHOWN_LINES:]
    if len(lines) > 1:
        return f"; its last messages: {'; '.join(lines)}"
    return f"; its last message: {lines[0]}" if lines else ""


def _other_step(member: Member, step: float, log: tuple[str, ...]) -> str:
    """Say which step to state for an FMU that refuses the one that it was asked for.

    Empty if a message, not of status ok, says why it failed, and that is no step; nor does it declare one.
    """
    option = written("--output-interval, or as step_size in a spec", "step_size")
    option = f"components.{member.name}.step" if member.step else option
    internal = member.description.info.internal_step
    if internal is None or abs(step / internal - max(1, round(step / internal))) < 1e-9:
        said = [line.lower() for line in log if line.strip() and not line.startswith("ok:")]
        said = [line for line in said if "dostep" not in line]  # the function, whatever failed in it
        is_explained = said and not any("step" in line for line in said)
        return "" if is_explained else f"; an FMU of one step only needs it as {option}"
    return (
        f"; the FMU's internal step is {internal:g} s: state a multiple of it as {option}, and round the "
        "times in formulas to multiples of that"
    )


def _status_name(status: int) -> str:
    if status == _PENDING:
        return "pending (steps that go on in the background are not supported)"
    if status < len(_STATUS_NAMES):
        return _STATUS_NAMES[status]
    return f"status {status - (1 << 32) if status >> 31 else status}"


def _out_of_time(plan: Plan) -> str:
    option = written("--time-limit, or time_limit in a spec", "time_limit")
    if not plan.shares:
        return f"after the time limit of {plan.time_limit:g} s; slow models need a larger {option}"
    share = f"{plan.time_limit:g} s without another tenth of the simulated time"
    return f"after {share}; slow models need {option}"


def _changes(network: Network, words: Sequence[str]) -> str:
    """Name the outputs that still change, and by how much, of which a worker tells the number first."""
    titles, changes = _titles(network, words[1::2]), words[2::2]
    shown = ", ".join(f"{t} (by {_short(change)})" for t, change in zip(titles, changes, strict=False))
    more = int(words[0]) - len(titles) if words and _is_position(words[0]) else 0
    return shown + (f" and {more} more" if more > 0 else "")


def _titles(network: Network, positions: Sequence[str]) -> list[str]:
    """Return the names of the connected outputs at these positions."""
    titles = [network.title(place) for place in network.connected_outputs()]
    return [titles[k] for k in map(int, filter(_is_position, positions)) if k < len(titles)]


def _string(network: Network, plan: Plan, reply: Reply) -> str:
    """Name the string parameter of a component at the position that a worker tells, and its value."""
    strings = network.of_member(_member(network, reply), plan.experiment.strings)
    known = _is_position(reply.text) and int(reply.text) < len(strings)
    name, value = strings[int(reply.text)] if known else ("a string", "a text")
    return f"{name!r} to {value!r}"


def _member(network: Network, reply: Reply) -> int:
    """Return the position among the components of the one that a worker tells; of the first if of none."""
    return network.order[reply.component] if 0 <= reply.component < len(network.order) else 0


def _is_position(text: str) -> bool:
    return text.isascii() and text.isdigit() and len(text) < 10


def _short(number: str) -> str:
    try:
        return f"{float(number):.3g}"
    except ValueError:
        return "an unknown number"
