"""Components of model exchange against what the single FMU and the equations say."""

from dataclasses import replace

import numpy as np
import pytest

from falsifier.core.model import Interface
from falsifier.core.signals import Interpolation, Signal
from falsifier.errors import SimulationError
from falsifier.fmu import Component, Connection, Coupling, Frame, System
from tests.fmu import fixtures
from tests.fmu.fixtures import ME, ramp
from tests.fmu.small_systems import LOOP, run, sampled_loop, solved, system

STEPS = 10


@pytest.mark.parametrize("pi", ["Gain_2", "Gain_3"])
@pytest.mark.parametrize("plant", ["Lag_2", "Lag_3"])
def test_both_interfaces_are_coupled_alike(plant: str, pi: str) -> None:
    for coupling, late in ((Coupling(), 0), (Coupling("jacobi"), 1)):
        model = system({"plant": solved(plant), "pi": pi}, LOOP, coupling)
        for _ in range(2):
            np.testing.assert_allclose(run(model, "plant.x")["plant.x"], sampled_loop(late), atol=1e-9)


def test_a_component_with_a_step_of_its_own_is_integrated_over_it() -> None:
    """The plant sees what the lag was at the end of each 0.2 s."""
    model = system({"lag": solved("Lag_2", 0.2), "plant": "Plant_2"}, {"plant.u": "lag.y"})
    found = run(model, "lag.x", "plant.x", signals={"lag.u": Signal((0.0,), (1.0,))})
    held = np.repeat((1.0 - np.exp(-found.times / 2.0))[::2], 2)[: STEPS + 1]
    np.testing.assert_allclose(found["lag.x"], held, atol=1e-7)
    x = [0.0]
    for u in held[1:].tolist():  # Gauss-Seidel: the lag has stepped before
        x.append(u + (x[-1] - u) * float(np.exp(-0.05)))
    np.testing.assert_allclose(found["plant.x"], x, atol=1e-7)


@pytest.mark.parametrize("name", ["Ticker_2", "Ticker_3"])
def test_time_events_are_met_within_a_step(name: str) -> None:
    """Events every 0.5 s, steps of 0.2 s: the plant has stepped before, so its value is that of the end."""
    model = system({"plant": "Plant_2", "ticker": solved(name)}, {"ticker.u": "plant.y"})
    names = ("plant.y", "ticker.sampled", "ticker.count", "ticker.x")
    found = run(model, *names, interval=0.2, stop=2.0, signals={"plant.u": Signal((0.0,), (1.0,))})
    assert found["ticker.count"].tolist() == [1, 1, 1, 2, 2, 3, 3, 3, 4, 4, 5]
    samples = [0.0, *(1.0 - np.exp(-np.array([0.6, 1.0, 1.6, 2.0]) / 2.0)).tolist()]
    np.testing.assert_allclose(
        found["ticker.sampled"], [samples[k] for k in (0, 0, 0, 1, 1, 2, 2, 2, 3, 3, 4)]
    )
    assert found["ticker.x"][-1] == pytest.approx(0.5 * sum(samples[:4]))


@pytest.mark.parametrize("interpolation", ["linear", "pchip"])
def test_discrete_inputs_follow_a_signal_in_steps_as_in_a_single_fmu(interpolation: Interpolation) -> None:
    signal, alone = Signal((0.0, 1.0), (0.0, 10.0), interpolation), fixtures.isolated("Echo_3me", ME)
    expected = fixtures.run(alone, ("out_Int32",), signals={"in_Int32": signal})["out_Int32"].tolist()
    parts, frame = {"a": solved("Echo_3me")}, Frame((replace(alone.info["in_Int32"], name="w"),))
    whole = System(parts, {"a.in_Int32": "w"}, frame=frame)
    for model, name in ((system(parts, {}), "a.in_Int32"), (whole, "w")):
        assert run(model, "a.out_Int32", signals={name: signal})["a.out_Int32"].tolist() == expected


@pytest.mark.parametrize("name", ["Ball_2", "Ball_3"])
def test_state_events_are_located_within_a_step(name: str) -> None:
    model = system({"ball": solved(name), "plant": "Plant_2"}, {"plant.u": "ball.h"})
    found = run(model, "ball.h", interval=0.25, stop=2.0)
    alone = fixtures.run(fixtures.isolated(name, ME), ("h",), interval=0.25, stop=2.0)
    np.testing.assert_allclose(found["ball.h"], alone["h"], atol=1e-7)
    assert found["ball.h"].min() >= -1e-6


def test_unconnected_inputs_are_followed_within_steps_and_connected_ones_can_be() -> None:
    """T x' = t - x, for any step: exact for a signal, of second order along the line through two values."""
    model = system({"lag": solved("Lag_2")}, {})
    found = run(model, "lag.x", interval=0.5, stop=5.0, signals={"lag.u": ramp(5.0)})
    exact = found.times - 2.0 + 2.0 * np.exp(-found.times / 2.0)
    np.testing.assert_allclose(found["lag.x"], exact, atol=3e-7)

    def error(extrapolation: str, step: float) -> float:
        link = Connection("a.y", extrapolation=extrapolation)  # type: ignore[arg-type]
        pair = system({"a": solved("Lag_2"), "b": solved("Lag_2")}, {"b.u": link})
        got = run(
            pair, "b.x", stop=4.0, interval=0.4, step_size=step, signals={"a.u": Signal((0.0,), (1.0,))}
        )
        whole = 1.0 - (1.0 + got.times / 2.0) * np.exp(-got.times / 2.0)
        return float(np.abs(got["b.x"] - whole).max())

    assert error("hold", 0.1) / error("hold", 0.05) == pytest.approx(2.0, rel=0.1)
    assert error("linear", 0.1) / error("linear", 0.05) == pytest.approx(4.0, rel=0.1)


def test_a_signal_is_converted_and_its_jumps_are_met() -> None:
    """An input of the whole in mm, which jumps within a step."""
    from falsifier.core.model import Variable
    from falsifier.fmu import Frame, System

    whole = Frame((Variable("s", causality="input", start=0.0, unit="mm"),))
    link = Connection("s", factor=0.001, offset=1.0)
    model = System({"lag": solved("Lag_2")}, {"lag.u": link}, frame=whole)
    step = Signal((0.0, 0.25), (0.0, 2000.0), "constant")
    found = run(model, "lag.x", interval=0.5, signals={"s": step})["lag.x"][-1]
    x = 1.0 - float(np.exp(-0.125))
    assert found == pytest.approx(3.0 + (x - 3.0) * np.exp(-0.375), abs=1e-6)
    assert run(model, "lag.x", interval=0.5)["lag.x"][-1] == pytest.approx(1.0 - np.exp(-0.5), abs=1e-6)


def test_discrete_inputs_change_at_events() -> None:
    model = system(
        {"a": "Echo_3", "b": solved("Echo_3me")},
        {"b.in_Int16": "a.out_Int16", "b.in_Boolean": "a.out_Boolean", "b.in_Float64": "a.out_Float64"},
    )
    signals = {
        "a.in_Int16": Signal((0.0, 1.0), (0.0, 10.0), "linear"),
        "a.in_Boolean": Signal((0.0,), (1.0,)),
        "b.in_Int32": Signal((0.0, 0.35), (3.0, 8.0), "constant"),
    }
    found = run(model, "a.out_Int16", "b.out_Int16", "b.out_Boolean", "b.out_Int32", signals=signals)
    assert found["b.out_Int16"].tolist() == found["a.out_Int16"].tolist() == [0, *range(10)]
    assert found["b.out_Boolean"].tolist() == [1.0] * 11
    assert found["b.out_Int32"].tolist() == [3.0] * 4 + [8.0] * 7


NOT_A_NUMBER, FAIL, END = 4, 8, 20


@pytest.mark.parametrize(
    ("misdeed", "said"),
    [
        (NOT_A_NUMBER, "no step is small enough: .*"),
        (FAIL, "the (step|event iteration) returned error"),
        (END, "the FMU terminated the simulation"),
    ],
)
def test_the_component_and_the_time_of_a_failure_are_told(misdeed: int, said: str) -> None:
    model = system({"plant": "Plant_2", "wild": solved("Wild_2"), "pi": "Gain_2"}, {"plant.u": "pi.y"})
    with pytest.raises(SimulationError, match=rf"^wild: {said} at t = 0\.[45] s"):
        run(model, "plant.x", parameters={"wild.misdeed": misdeed})
    assert run(model, "wild.x")["wild.x"][-1] == pytest.approx(1.0)


@pytest.mark.parametrize("interface", ["co-simulation", ME])
@pytest.mark.parametrize("name", ["Strict_2", "Strict_3"])
def test_steps_that_are_repeated_are_not_promised_to_be_final(name: str, interface: Interface) -> None:
    """The FMU returns early for its events (FMI 3), or is told of each step of the solver."""
    ticker = Component(fixtures.path(name), interface=interface)
    links = {"ticker.u": "gain.y", "gain.measured": "ticker.x"}
    model = system({"ticker": ticker, "gain": "Gain_2"}, links, Coupling(loops="iterate"))
    first, again = (run(model, "ticker.count", "ticker.x", interval=0.2, stop=2.0) for _ in range(2))
    assert first["ticker.count"][-1] == 5.0 and first["ticker.x"].tolist() == again["ticker.x"].tolist()
