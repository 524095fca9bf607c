"""What a worker's replies, and its end, mean in words."""

from falsifier.errors import FalsifierError, ModelError, SimulationError
from falsifier.fmu.process.connection import Reply, Where
from falsifier.fmu.process.plan import Plan

_STATUS_NAMES = ("ok", "warning", "discard", "error", "fatal", "pending")
_ENDS = {
    Where.TERMINATED: "the FMU terminated the simulation",
    Where.STUCK: "the FMU makes no progress: its events never end",
    Where.TOO_SMALL: (
        "no step is small enough: the derivatives are NaN, infinite or discarded, or change too fast"
    ),
}
_DOINGS = {
    Where.SETTING: "setting the inputs",
    Where.STEPPING: "the step",
    Where.GETTING: "reading the outputs",
}
# The last messages that an error tells.
_SHOWN_LINES = 3


def status_name(status: int) -> str:
    """Return the name of an FMI status."""
    if status < len(_STATUS_NAMES):
        return _STATUS_NAMES[status]
    return f"status {status - (1 << 32) if status >> 31 else status}"


def failure(plan: Plan, reply: Reply, refusals: str, log: tuple[str, ...]) -> FalsifierError:
    """Return the error for a simulation of an FMU that did not reach its stop time.

    Args:
        plan: of the simulation.
        reply: how it ended.
        refusals: what the FMU tried and was refused, for the end of the message.
        log: what the FMU has said.
    """
    if reply.where == Where.IMPOSSIBLE:
        return ModelError(f"{plan.model}: {reply.text}{refusals}")
    end = refusals + last_lines(log)
    if reply.where == Where.TIMEOUT:
        text = f"{plan.model}: stopped at t = {reply.time:g} s {_out_of_time(plan)}{end}"
        return SimulationError(text, status="timeout", time=reply.time, log=log)
    time = None if reply.time < 0 else reply.time
    return SimulationError(f"{plan.model}: {_reason(plan, reply)}{end}", time=time, log=log)


def overdue(plan: Plan, reached: float, during: str, log: tuple[str, ...]) -> SimulationError:
    """Return the error for a simulation whose process was ended because it did not return in time."""
    at = f" at t = {reached:g} s" if 0.0 < reached <= plan.stop_time else ""
    return SimulationError(
        f"{plan.model}: did not return{at}{during} and was stopped {_out_of_time(plan)}{last_lines(log)}",
        status="timeout",
        time=reached if at else None,
        log=log,
    )


def crash(plan: Plan, reason: str, log: tuple[str, ...]) -> SimulationError:
    """Return the error for a simulation that its process did not survive."""
    return SimulationError(f"{plan.model}: {reason}{last_lines(log)}", status="crashed", log=log)


def last_lines(log: tuple[str, ...]) -> str:
    """Return the end of an error message: the last of the FMU's messages."""
    lines = tuple(dict.fromkeys(line for line in log if line.strip()))[-_SHOWN_LINES:]
    if len(lines) > 1:
        return f"; its last messages: {'; '.join(lines)}"
    return f"; its last message: {lines[0]}" if lines else ""


def _out_of_time(plan: Plan) -> str:
    if plan.has_limit:
        return f"after the time limit of {plan.time_limit:g} s; slow models need a larger time_limit"
    share = f"{plan.time_limit:g} s without another tenth of the simulated time"
    return f"after {share}; slow models need a time_limit"


def _reason(plan: Plan, reply: Reply) -> str:
    returned = f"returned {status_name(reply.status)}"
    if reply.where == Where.CANNOT_RENEW:
        return reply.text
    if reply.where == Where.CALLING:
        return f"{reply.text} {returned} at the start of the simulation"
    if reply.where == Where.WRITING:
        return f"setting the {reply.text} {returned}"
    if reply.where == Where.TEXT:
        name, value = _string(plan, reply.text)
        return f"setting {name!r} to {value!r} {returned}"
    doing = next((said for where, said in _DOINGS.items() if where == reply.where), "the event iteration")
    ended = next((said for where, said in _ENDS.items() if where == reply.where), f"{doing} {returned}")
    return f"{ended} at t = {reply.time:g} s, before the stop time {plan.stop_time:g} s"


def _string(plan: Plan, position: str) -> tuple[str, str]:
    """Return the string parameter at a position that the worker tells, which may tell anything."""
    known = position.isascii() and position.isdigit() and int(position[:9]) < len(plan.strings)
    return plan.strings[int(position)] if known else ("a string", "a text")
