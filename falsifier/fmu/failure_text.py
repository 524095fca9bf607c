"""Failures of worker processes in words."""

from falsifier.errors import FailureStatus, SimulationError
from falsifier.fmu.channel import Reply

# The last messages that an error tells.
_SHOWN_LINES = 3


def simulation_error(reply: Reply, log: tuple[str, ...]) -> SimulationError:
    """Return the error for a worker's reply that a simulation failed."""
    time = None if reply.time < 0 else reply.time
    status: FailureStatus = "timeout" if reply.status == "timeout" else "failed"
    return SimulationError(reply.text + last_lines(log), status=status, time=time, log=log)


def last_lines(log: tuple[str, ...]) -> str:
    """Return the end of an error message: the last of the FMU's messages."""
    lines = tuple(dict.fromkeys(line for line in log if line.strip()))[-_SHOWN_LINES:]
    if len(lines) > 1:
        return f"; its last messages: {'; '.join(lines)}"
    return f"; its last message: {lines[0]}" if lines else ""
