from falsifier.fmu.channel import Reply
from falsifier.fmu.failure_text import last_lines, simulation_error


def test_the_last_messages_are_told_once_each() -> None:
    assert last_lines(()) == last_lines(("", " ")) == ""
    assert last_lines(("error: a",)) == "; its last message: error: a"
    assert last_lines(("1", "2", "2", "3", "4")) == "; its last messages: 2; 3; 4"


def test_an_error_keeps_status_time_and_messages() -> None:
    error = simulation_error(Reply("timeout", "stopped", time=2.0), ("slow",))
    assert (str(error), error.status, error.time, error.log) == (
        "stopped; its last message: slow",
        "timeout",
        2.0,
        ("slow",),
    )
    assert simulation_error(Reply("failed", "no", time=-1.0), ()).time is None
