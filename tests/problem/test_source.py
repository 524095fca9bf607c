import pytest

from falsifier.problem.loading import load_source
from falsifier.problem.shorthand import changes_from_options
from falsifier.problem.source import ProblemSource

CHANGED = ProblemSource(target="AT1", changes=changes_from_options(values=["brake=0"], stop_time=30.0))


@pytest.mark.parametrize(
    ("target", "name"),
    [("AT1", "AT1"), ("specs/AT.toml:AT1", "AT1"), ("python:a.b:make", "make"), ("my.fmu", "my")],
)
def test_its_name_is_the_targets_last_part(target: str, name: str) -> None:
    assert ProblemSource(target=target).name == name


def test_equal_sources_are_equal_keys() -> None:
    again = ProblemSource(target="AT1", changes=changes_from_options(values=["brake=0"], stop_time=30.0))
    assert len({CHANGED, again, ProblemSource(target="AT1")}) == 2


def test_what_is_not_stated_stays_so_through_json() -> None:
    read = ProblemSource.model_validate_json(CHANGED.model_dump_json())
    assert read == CHANGED
    assert "output_interval" not in CHANGED.model_dump_json()
    problem, bundled = load_source(read), load_source(ProblemSource(target="AT1"))
    assert problem.experiment.stop_time == 30.0
    assert problem.experiment.output_interval == bundled.experiment.output_interval
    assert (dict(problem.parameters), problem.space.inputs) == ({"brake": 0.0}, bundled.space.inputs[:1])
