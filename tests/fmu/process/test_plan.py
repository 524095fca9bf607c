"""What simulations have in common is checked once."""

import pytest

from falsifier.core.experiment import Experiment
from falsifier.errors import ModelError
from falsifier.fmu.description.model_description import read_description
from falsifier.fmu.process.outcome import crash
from falsifier.fmu.process.plan import make_plan
from tests.fmu import fixtures

LAG = read_description(fixtures.path("Lag_2"))


@pytest.mark.parametrize(
    ("inputs", "parameters", "outputs", "message"),
    [
        (["v"], [], ["y"], "no variable 'v'"),
        (["y"], [], ["y"], "'y' is not an input, its causality is output; the inputs are: u"),
        (["u"], ["y"], ["y"], "'y' cannot be set: the model computes"),
        (["u"], ["gian"], ["y"], "did you mean 'gain'"),
        (["u"], [], ["z"], "no variable 'z'"),
    ],
)
def test_wrong_names_are_refused_with_the_reason(
    inputs: list[str], parameters: list[str], outputs: list[str], message: str
) -> None:
    with pytest.raises(ModelError, match=message):
        make_plan(LAG, Experiment(1.0, 0.1, tuple(outputs)), inputs, parameters)


def test_the_time_of_a_crash_stands_after_what_happened_whatever_names_contain() -> None:
    plan = make_plan(LAG, Experiment(1.0, 0.1, ("y",)), [], [])
    told = crash(plan, 0.5, "the FMU replaced its program by /a: b", "; the FMU tried it", ())
    assert str(told).endswith("by /a: b at t = 0.5 s; the FMU tried it")
