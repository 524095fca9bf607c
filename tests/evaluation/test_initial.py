from dataclasses import replace

from falsifier.core.model import FunctionModel
from falsifier.evaluation.evaluate import start_values
from falsifier.problem.loading import load_problem
from falsifier.testing import START, Array, lag_problem


def test_outputs_at_time_0_and_whether_they_depend_on_what_is_chosen() -> None:
    assert start_values(lag_problem()) == {"x": (0.0, 0.0)}
    start = start_values(lag_problem(parameters=[START]))
    assert start == {"x": (START.low, START.high)}


def test_an_fmu_is_initialised_without_a_whole_simulation() -> None:
    problem = load_problem("AT1")
    assert start_values(problem) == {"speed": (0.0, 0.0), "rpm": (1000.0, 1000.0), "gear": (1.0, 1.0)}
    problem.model.close()


def test_a_component_whose_step_is_longer_than_an_output_step_is_no_hindrance() -> None:
    problem = load_problem("ATsplit1")  # the shift logic runs every 0.04 s, the outputs are read every 0.01 s
    assert start_values(problem)["car.rpm"] == (1000.0, 1000.0)
    problem.model.close()


def _fails(times: Array, inputs: dict[str, Array], parameters: dict[str, float]) -> dict[str, Array]:
    raise ValueError("no start")


def test_what_cannot_be_initialised_has_no_start() -> None:
    problem = lag_problem()
    assert start_values(replace(problem, model=FunctionModel(_fails, problem.info))) == {}
