import numpy as np
import pytest

from falsifier.errors import ModelError, SimulationError
from falsifier.fmu.description import read_description
from falsifier.fmu.process import encoding
from falsifier.fmu.process.connection import Reply, Where
from falsifier.fmu.process.outcome import check_range, failure, last_lines, status_name
from falsifier.fmu.process.plan import Plan
from tests.fmu import fixtures

ECHO = read_description(fixtures.path("Echo_3"))
PLAN = Plan((), (), (), 1.0, 2, 1, 1, 0.1, None, 5.0, (("file", "a.txt"),))


@pytest.mark.parametrize(
    ("name", "row", "fits"),
    [
        ("in_Int8", [-128.4, 127.4], True),
        ("in_Int8", [-129.0, 0.0], False),
        ("in_UInt8", [0.0, 256.0], False),
        ("in_UInt8", [-0.4, 255.0], True),  # is rounded
        ("in_Boolean", [0.0, 1.0], True),
        ("in_Float64", [-1e300, 1e300], True),
    ],
)
def test_values_must_fit_the_type_of_their_variable(name: str, row: list[float], fits: bool) -> None:
    limits, rows = encoding.limits(ECHO, [name]), np.array([row])
    if fits:
        check_range("Echo", [name], limits, rows)
    else:
        with pytest.raises(SimulationError, match=f"Echo: .*'{name}'"):
            check_range("Echo", [name], limits, rows)


def test_the_last_messages_are_told_once_each() -> None:
    assert last_lines(()) == last_lines(("", " ")) == ""
    assert last_lines(("error: a",)) == "; its last message: error: a"
    assert last_lines(("1", "2", "2", "3", "4")) == "; its last messages: 2; 3; 4"


def test_statuses_have_names() -> None:
    assert [status_name(s) for s in (0, 1, 3, 99)] == ["ok", "warning", "error", "status 99"]
    assert status_name((1 << 32) - 2) == "status -2"


@pytest.mark.parametrize(
    ("reply", "said"),
    [
        (Reply(Where.STEPPING, 3, time=0.5), r"M: the step returned error at t = 0\.5 s, before .* 1 s"),
        (Reply(Where.TERMINATED, time=0.5), r"M: the FMU terminated the simulation at t = 0\.5 s"),
        (Reply(Where.CALLING, 3, "Initialize", 0.0), "M: Initialize returned error at the start"),
        (Reply(Where.WRITING, 2, "inputs", 0.0), "M: setting the inputs returned discard"),
        (Reply(Where.TEXT, 3, "0", 0.0), r"M: setting 'file' to 'a\.txt' returned error"),
        (Reply(Where.TEXT, 3, "9999999999999", 0.0), "M: setting 'a string' to 'a text' returned error"),
        (Reply(Where.TIMEOUT, time=0.5), r"M: stopped at t = 0\.5 s after the time limit of 5 s"),
    ],
)
def test_where_a_simulation_stopped_is_told(reply: Reply, said: str) -> None:
    found = failure("M", PLAN, reply, "", ("slow",))
    assert isinstance(found, SimulationError)
    with pytest.raises(SimulationError, match=rf"^{said}.*; its last message: slow$"):
        raise found
    assert (found.time, found.log) == (reply.time, ("slow",))
    assert found.status == ("timeout" if reply.where == Where.TIMEOUT else "failed")


def test_an_fmu_that_cannot_be_used_is_no_failed_simulation() -> None:
    with pytest.raises(ModelError, match=r"^M: it lacks fmi2DoStep$"):
        raise failure("M", PLAN, Reply(Where.IMPOSSIBLE, text="it lacks fmi2DoStep"), "", ())
