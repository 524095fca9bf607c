"""Systems against what they are by their equations: the plant's exact response to inputs held over a step."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from falsifier.core.signals import Signal
from falsifier.errors import SimulationError
from falsifier.fmu import Component, Coupling
from falsifier.fmu.process.network import Method
from tests.fmu.fixtures import altered, path
from tests.fmu.small_systems import LOOP, STEP, loop, run, sampled_loop, solved, system
from tests.fmu.support import ERROR, NAN

DELAY = Coupling(loops="delay")


@pytest.mark.parametrize("pi", ["Gain_2", "Gain_3"])
@pytest.mark.parametrize("plant", ["Plant_2", "Plant_3"])
def test_gauss_seidel_has_no_delay_and_jacobi_one_step(plant: str, pi: str) -> None:
    for coupling, late in ((Coupling(), 0), (Coupling("jacobi"), 1)):
        found = run(loop(coupling, plant=plant, pi=pi), "plant.x", "pi.y")
        expected = sampled_loop(late)
        np.testing.assert_allclose(found["plant.x"], expected, atol=1e-9)
        shown = 2.0 * (1.0 - (expected if not late else np.concatenate([expected[:1], expected[:-1]])))
        np.testing.assert_allclose(found["pi.y"], shown, atol=1e-9)


def test_a_smaller_communication_step_keeps_the_output_grid() -> None:
    found = run(loop(), "plant.x", step_size=0.02)
    np.testing.assert_allclose(found["plant.x"], sampled_loop(0, steps=50, step=0.02)[::5], atol=1e-9)


def test_a_loop_at_initialisation_converges_to_its_solution() -> None:
    """a.y = ka (1 - b.y), b.y = kb (1 - a.y)."""
    model = system({"a": "Gain_2", "b": "Gain_3"}, {"a.measured": "b.y", "b.measured": "a.y"}, DELAY)
    found = run(model, "a.y", "b.y", parameters={"a.k": 0.5, "b.k": 0.8})
    a = 0.5 * (1.0 - 0.8) / (1.0 - 0.5 * 0.8)
    np.testing.assert_allclose(found["a.y"], a, atol=1e-8)
    np.testing.assert_allclose(found["b.y"], 0.8 * (1.0 - a), atol=1e-8)


def test_a_loop_that_does_not_converge_is_named_with_its_variables() -> None:
    model = system({"a": "Gain_2", "b": "Gain_3"}, {"a.measured": "b.y", "b.measured": "a.y"}, DELAY)
    with pytest.raises(
        SimulationError,
        match=r"initialisation does not converge: after 100 rounds .*: a\.y \(by .*\), b\.y \(by .*in a loop",
    ) as failed:
        run(model, "a.y")
    assert failed.value.time == 0.0


def implicit(steps: int, step: float, *, gain: float, direct: float) -> NDArray[np.float64]:
    """States of a lead whose input u = gain (1 - x - direct u) is held, with x at the step's end; T = 2."""
    x, decay = [0.0], float(np.exp(-step / 2.0))
    for _ in range(steps):
        u = gain * (1.0 - x[-1] * decay) / (1.0 + gain * direct + gain * (1.0 - decay))
        x.append(u + (x[-1] - u) * decay)
    return np.array(x)


@pytest.mark.parametrize("lead", [path("Lead_2"), path("Lead_3"), solved("Lead_2"), solved("Lead_3")])
@pytest.mark.parametrize("pi", ["Gain_2", "Gain_3"])
def test_a_direct_loop_is_iterated_to_its_solution(lead: Path | Component, pi: str) -> None:
    """Both outputs depend on each other at once; with a delay, they would be those of the step before."""
    each = lead if isinstance(lead, Component) else Component(lead)
    model = system({"pi": pi, "plant": each}, LOOP, Coupling(loops="iterate", tolerance=1e-12))
    assert model.network.loops == ((0, 2),)
    assert "pi, plant repeat their steps until the outputs no longer change" in model.info.notes[0:2]
    for _ in range(2):
        found = run(model, "plant.x", "plant.y", "pi.y", parameters={"pi.k": 1.0})
        np.testing.assert_allclose(found["plant.x"], implicit(10, STEP, gain=1.0, direct=0.5), atol=1e-8)
        np.testing.assert_allclose(found["plant.y"], found["plant.x"] + 0.5 * found["pi.y"], atol=1e-8)
        np.testing.assert_allclose(found["pi.y"], 1.0 - found["plant.y"], atol=1e-8)
    model.close()


def test_a_step_that_does_not_converge_is_named_with_its_variables() -> None:
    model = system({"plant": "Lead_2", "pi": "Gain_2", "other": "Plant_2"}, LOOP, Coupling(loops="iterate"))
    late = {"pi.r": Signal((0.0, 0.3), (0.0, 1.0), "constant")}
    message = (
        r"^system: the loop of pi, plant does not converge at t = 0\.3 s: after 100 rounds, these still "
        r"change: plant\.y \(by .*\), pi\.y \(by .*\); raise .*loops = \"delay\""
    )
    with pytest.raises(SimulationError, match=message) as failed:
        run(model, "plant.y", signals=late, parameters={"pi.k": 4.0})
    assert failed.value.time == pytest.approx(0.3)
    assert run(model, "plant.y", signals=late, parameters={"pi.k": 0.5})["plant.y"][-1] > 0.0


# The controlled plant with a third component, which gives the reference.
LED = {**LOOP, "pi.r": "bad.y"}


@pytest.mark.parametrize(
    ("coupling", "misdeed", "said"),
    [
        (Coupling(), NAN, r"bad\.y became nan"),
        (Coupling("jacobi"), NAN, r"bad\.y became nan"),
        (Coupling(loops="iterate"), NAN, r"bad\.y became nan"),
        (Coupling(loops="iterate"), ERROR, "the step returned error"),
    ],
)
def test_a_component_that_fails_is_named_and_not_the_one_that_receives_its_output(
    coupling: Coupling, misdeed: float, said: str
) -> None:
    plant = "Lead_2" if coupling.loops == "iterate" else "Plant_2"
    model = system({"plant": plant, "pi": "Gain_2", "bad": "Misdeeds_2"}, LED, coupling)
    with pytest.raises(SimulationError, match=rf"^bad: {said} at t = 0\.5 s"):
        run(model, "plant.x", parameters={"bad.misdeed": misdeed, "pi.k": 1.0})


@pytest.mark.parametrize(
    ("parameter", "named"),
    [("plant.x", r"plant: plant\.y"), ("pi.k", r"pi: pi\.y"), ("bad.k", r"bad: bad\.y")],
)
def test_an_output_that_is_nan_at_time_0_is_named_and_not_the_loop_that_it_spreads_in(
    parameter: str, named: str
) -> None:
    model = system({"plant": "Lead_2", "pi": "Gain_2", "bad": "Gain_3"}, LED, DELAY)
    with pytest.raises(SimulationError, match=f"^{named} is nan at t = 0 s, in the init") as failed:
        run(model, "plant.x", parameters={"pi.k": 0.5, parameter: float("nan")})
    assert failed.value.time == 0.0
    assert np.isfinite(run(model, "plant.x", parameters={"pi.k": 0.5})["plant.x"]).all()


@pytest.mark.parametrize("coupling", [Coupling(), Coupling("jacobi"), Coupling(loops="iterate")])
def test_an_output_may_be_infinite(coupling: Coupling) -> None:
    """As the time to a collision is that of a car that stands; a value that is not recorded may be so."""
    model = system({"far": "Gain_2", "b": "Gain_2", "plant": "Plant_2"}, {"b.measured": "far.y"}, coupling)
    found = run(model, "plant.x", parameters={"far.k": 1e200, "far.r": 1e200})
    assert np.isfinite(found["plant.x"]).all()
    ring = {"a.measured": "b.y", "b.measured": "c.y", "c.measured": "a.y"}
    model = system(dict.fromkeys("abc", "Gain_2"), ring, DELAY)
    with pytest.raises(SimulationError, match="does not converge"):
        run(model, "a.y", parameters={"a.k": 1e80, "b.k": 1e80, "c.k": 1e80})


@pytest.mark.parametrize("method", ["gauss-seidel", "jacobi"])
def test_an_output_that_is_nan_after_the_initialisation_is_named_and_not_the_component_that_receives_it(
    method: Method,
) -> None:
    """It samples its input at time 0, when initialisation has ended."""
    links = {"plant.u": "ticker.sampled"}
    model = system({"ticker": "Ticker_3", "plant": "Plant_2"}, links, Coupling(method))
    message = r"^ticker: ticker\.sampled is nan at t = 0 s, after the initialisation"
    with pytest.raises(SimulationError, match=message):
        run(model, "plant.y", parameters={"ticker.u": float("nan")})


def test_the_time_limit_counts_for_the_whole_system() -> None:
    with pytest.raises(SimulationError, match=r"system: stopped at t = .* after the time limit of") as late:
        run(loop(), "plant.x", stop=1000.0, interval=0.01, time_limit=1e-9)
    assert late.value.status == "timeout"


def test_values_that_do_not_fit_their_type_are_refused_with_the_component() -> None:
    model = system({"a": "Echo_3"}, {})
    with pytest.raises(
        SimulationError, match=r"^system: values from 0 to 300 do not fit 'a.in_Int8', .* -128 to 127"
    ):
        run(model, "a.out_Int8", signals={"a.in_Int8": Signal((0.0, 1.0), (0.0, 300.0), "linear")})
    with pytest.raises(SimulationError, match=r"values from 1e\+39 to 1e\+39 do not fit 'a.in_Float32'"):
        run(model, "a.out_Float32", signals={"a.in_Float32": Signal((0.0,), (1e39,))})


@pytest.mark.parametrize(
    ("narrow", "value", "given"),
    [("Int8", 300, 127), ("Int8", -300, -128), ("UInt8", -5, 0), ("UInt64", -5, 0)],
)
def test_outputs_beyond_their_declared_limits_become_the_nearest_value_of_the_input(
    narrow: str, value: int, given: int, tmp_path: Path
) -> None:
    limits = b'name="out_Int16" min="0" max="100"'
    liar = altered(
        path("Echo_3"),
        tmp_path / "Liar.fmu",
        lambda xml: xml.replace(b'name="out_Int16"', limits),
        ending="modelDescription.xml",
    )
    model = system({"a": Component(liar), "b": "Echo_3"}, {f"b.in_{narrow}": "a.out_Int16"})
    held = Signal((0.0, 1.0), (float(value), float(value)), "linear")
    assert run(model, f"b.out_{narrow}", signals={"a.in_Int16": held})[f"b.out_{narrow}"][-1] == given
