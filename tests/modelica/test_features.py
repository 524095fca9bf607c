"""One small model for each feature of the language, with a solution that is known in closed form."""

import math

import numpy as np
import pytest

from falsifier.core.experiment import Experiment
from falsifier.core.model import Interface
from falsifier.core.signals import Signal
from falsifier.fmu import FmuModel, read_info
from tests.modelica.conftest import Build
from tests.modelica.support import INTERFACES, Floats, opened, said_on_failure


def final(
    build: Build, model: str, names: list[str], stop: float, size: float = 0.1, **values: float
) -> list[float]:
    with opened(build(model)) as [fmu]:
        return [float(x) for x in fmu.start(**values).run(names, stop, size)[-1, 1:]]


def test_start_values_and_calculated_parameters(build: Build) -> None:
    assert final(build, "Decay", ["x", "y"], 1) == pytest.approx(
        [3 * math.exp(-2), 6 * math.exp(-2)], rel=1e-8
    )
    x, y = final(build, "Decay", ["x", "y"], 1, k=4, x0=1)
    assert (x, y) == pytest.approx((math.exp(-4), 2 * math.exp(-4)), rel=1e-8)


def test_inputs_are_held_in_a_step(build: Build) -> None:
    with opened(build("Decay")) as [fmu]:
        rows = fmu.start(x0=0.0).run(["x"], 1, 0.25, lambda t: {"u": t})
    x = 0.0
    for k in range(4):
        x = 0.25 * k / 2 + (x - 0.25 * k / 2) * math.exp(-0.5)
        assert rows[k + 1, 1] == pytest.approx(x, rel=1e-8)


@pytest.mark.parametrize(("size", "stop"), [(0.003, 1.2), (0.04, 5.0), (1.0, 2.0)])
def test_bouncing_ball_bounces_where_it_must_at_any_step(build: Build, size: float, stop: float) -> None:
    with opened(build("Ball")) as [fmu]:
        rows = fmu.start().run(["h", "bounces"], stop, size)
    for t, h, bounces in rows:
        assert (h, bounces) == pytest.approx(ball(t), abs=1e-7)


def ball(t: float) -> tuple[float, int]:
    """Height and number of bounces of the ball."""
    if t < math.sqrt(2 / 9.81):
        return 1 - 0.5 * 9.81 * t * t, 0
    t -= math.sqrt(2 / 9.81)
    v, bounces = 0.7 * math.sqrt(2 * 9.81), 1
    while t > 2 * v / 9.81:
        t, v, bounces = t - 2 * v / 9.81, 0.7 * v, bounces + 1
        if bounces == 12:
            return 0.0, 12
    return v * t - 0.5 * 9.81 * t * t, bounces


def test_sampling_is_exact(build: Build) -> None:
    with opened(build("Counter")) as [fmu]:
        rows = fmu.start().run(["ticks", "held", "late", "odd"], 2, 1 / 90)
    k = np.arange(181)
    assert np.array_equal(rows[:, 1], k // 3 + 1)
    assert rows[:, 2] == pytest.approx(k // 3 / 30, abs=1e-12)
    assert np.array_equal(rows[:, 3], 10 - np.searchsorted([0.25, 0.75, 1.25, 1.75], k / 90, side="right"))
    assert np.array_equal(rows[:, 4], rows[:, 1] % 2)


def test_sampling_after_a_late_start(build: Build) -> None:
    with opened(build("Counter")) as [fmu]:
        fmu.start(time=1.02)
        fmu.step(0.05)
        assert fmu.get("ticks") == 2  # 31/30 and 32/30
        assert fmu.get("held") == pytest.approx(32 / 30, abs=1e-12)


def test_equations_in_any_order(build: Build) -> None:
    names = ["a", "b", "c", "d", "f", "late", "n"]
    assert final(build, "Algebra", names, 0.4) == pytest.approx(
        [0.4, 0.7, 3.7, 10 / 3.7, 4 * (10 / 3.7 - 1), 0, -7]
    )
    assert final(build, "Algebra", names, 1) == pytest.approx([1, 1, 4, 2.5, 6, 1, 7])


def test_functions(build: Build) -> None:
    names = ["value", "linear", "count", "few", "mean[1]", "mean[2]", "largest", "mixed", "jump", "chosen"]
    assert final(build, "Functions", names, 0.4) == pytest.approx([1.32, 1.8, 5, 2, 2, 6, 9, 10.2, 2.4, 2])
    assert final(build, "Functions", names, 1) == pytest.approx([3, 3, 5, 2, 2, 6, 9, 12, 1, 11])


def test_empty_ranges_results_in_arguments_defaults_and_values_before_an_event(build: Build) -> None:
    names = ["loops", "own[1]", "own[2]", "value", "atState", "atTick"]
    assert final(build, "Corners", names, 1, 0.5) == pytest.approx([0, 2, 4, 405, 1.1, 2])


def test_a_result_of_another_size_stops_the_simulation(build: Build) -> None:
    assert "different sizes" in said_on_failure(build("Corners"), ("x",), m=5)


def test_a_time_event_is_found_though_times_are_added_up(build: Build) -> None:
    with opened(build("Corners")) as [fmu]:
        fmu.start()
        for _ in range(8):
            fmu.step(0.1)
        assert fmu.time < 0.8
        assert fmu.get("passed") == 1


def test_arrays_and_arrays_of_components(build: Build) -> None:
    names = ["v[1]", "v[2]", "v[3]", "last", "both", "total", "slow"]
    c, tanks = math.cos(1), [k * (1 - math.exp(-1 / T)) for k, T in ((1, 1), (2, 2), (3, 4))]
    expected = [c, 2 * c + 1, 3 * c, 3 * c, 1, 3 * c + 1 + sum(tanks), tanks[2]]
    assert final(build, "Arrays", names, 1) == pytest.approx(expected, rel=1e-7)


def test_array_assignment_that_shifts_an_array(build: Build) -> None:
    names = [f"history[{k}]" for k in range(1, 5)]
    assert final(build, "Arrays", names, 0.65, 0.05) == pytest.approx([0.6, 0.5, 0.4, 0.3])


def test_extends_and_import(build: Build) -> None:
    assert final(build, "Inherited", ["x", "z", "w"], 1) == pytest.approx(
        [2 * math.exp(-3), 6 * math.exp(-3), 5]
    )


def test_located_events_follow_each_other_for_a_long_time(build: Build) -> None:
    with opened(build("Thermostat")) as [fmu]:
        rows = fmu.start().run(["x", "switches", "heating"], 20, 0.05)
    phase = (rows[:, 0] + 0.5) % (4 / 3)
    assert rows[:, 1] == pytest.approx(np.where(phase <= 1, 1 + phase, 2 - 3 * (phase - 1)), abs=1e-9)
    assert rows[-1, 2] == 30
    clear = (np.abs(phase - 1) > 1e-6) & (phase > 1e-6) & (phase < 4 / 3 - 1e-6)
    assert np.array_equal(rows[clear, 3], phase[clear] < 1)


def test_time_events_and_whole_parts(build: Build) -> None:
    names = ["early", "stairs", "saw", "whole", "smoothed"]
    early = 0.35 + 3.5 + 30
    stairs = 0.25 * (0 + 1 + 2 + 3) - 1
    saw = 3 * 0.045 + 0.005
    assert final(build, "Times", names, 1, 0.2) == pytest.approx([early, stairs, saw, 4, 1.5], abs=1e-9)
    assert final(build, "Times", ["early"], 1, 0.2, t1=0.45)[0] == pytest.approx(0.45 + 4.5 + 10, abs=1e-9)


def test_initial_equations_and_initial_when(build: Build) -> None:
    names = ["x", "y", "d", "mode", "first", "sum"]
    with opened(build("Starts")) as [fmu]:
        rows = fmu.start(p=4).run(names, 1, 0.1)
    assert rows[0, 1:] == pytest.approx([5, 20, 6, 5, 1, 31])
    assert rows[6, 1:] == pytest.approx([5, 20.6, 7, 5, 0, 32.6])
    assert rows[-1, 1:] == pytest.approx([5, 21, 7, 15, 0, 33])


def test_algorithm_section_with_continuous_and_sampled_parts(build: Build) -> None:
    with opened(build("Mixed")) as [fmu]:
        rows = fmu.start().run(["smooth", "kept", "twice"], 1, 0.1)
    assert rows[:, 1] == pytest.approx(rows[:, 0] + 1)
    assert rows[:, 2] == pytest.approx([-1] * 5 + [1.5] * 2 + [11.5] * 3 + [2])
    assert rows[:, 3] == pytest.approx(2 * rows[:, 2])


def test_if_equations_and_discrete_inputs(build: Build) -> None:
    with opened(build("Switched")) as [fmu]:
        fmu.start(level=2)
        assert fmu.row(["x", "y", "changes"]) == [0, 0, 0]
        fmu.step(0.5)
        fmu.set({"on": 1})
        fmu.step(0.5)
        assert fmu.row(["x", "y", "changes"]) == pytest.approx([1, 2, 0])
        fmu.set({"on": 0, "level": 3})
        fmu.step(0.01)
        assert fmu.row(["x", "y", "changes"]) == pytest.approx([2, -1, 1])


def test_an_assertion_stops_the_simulation_with_its_message(build: Build) -> None:
    said = said_on_failure(build("Switched"), ("x",), level=3)
    assert "Switched.mo:23: x has left its range" in said


def test_elementary_functions(build: Build) -> None:
    u = 0.4
    functions = ["sqrt", "exp", "log", "log10", "sin", "cos", "tan", "asin", "acos", "atan"]
    expected = [getattr(math, name)(u) for name in functions]
    expected += [math.atan2(u, -1), math.sinh(u), math.cosh(u), math.tanh(u), u, 0.25, u, u**3, u**2]
    names = [f"y[{k}]" for k in range(1, 20)]
    with opened(build("Elementary")) as [fmu]:
        assert fmu.start(u=u).row(names) == pytest.approx(expected, rel=1e-14)


WAIT, UP, DOWN = 1.0, 2.0, 3.0


@pytest.mark.parametrize("fmi", [2, 3])
def test_items_are_described(build: Build, fmi: int) -> None:
    variables = {v.name: v for v in read_info(build("Enumerated", fmi=fmi)).variables}
    for name, start in (("command", WAIT), ("counted", UP), ("before", DOWN)):
        assert variables[name].kind == "enumeration"
        assert variables[name].literals == {"Wait": 1, "Up": 2, "Down": 3}
        assert variables[name].start == start
    assert "kept[1]" not in variables


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("interface", INTERFACES)
def test_enumerations_as_inputs_parameters_and_states(build: Build, fmi: int, interface: Interface) -> None:
    command = Signal((0.0, 0.2, 0.4, 0.6, 0.8), (WAIT, UP, DOWN, UP, UP), "constant")
    outputs = ("count", "before", "code", "later", "gain[1]", "gain[2]", "gain[3]")
    model = FmuModel(build("Enumerated", fmi=fmi), interface=interface)
    for counted, expected in ((UP, [0, 1, 1, 2, 2]), (DOWN, [0, 0, 1, 1, 1])):
        found = model.simulate({"command": command}, {"counted": counted}, Experiment(1.0, 0.1, outputs))
        rows = np.column_stack([found[name] for name in outputs])[1::2]
        assert rows[:, 0].tolist() == expected
        assert rows[:, 1].tolist() == [DOWN, WAIT, UP, DOWN, DOWN]
        assert rows[:, 2].tolist() == [13, 21, 32, 23, 23]
        assert rows[:, 3].tolist() == [float(c > counted) for c in (WAIT, UP, DOWN, UP, UP)]
        assert rows[:, 4].tolist() == [0, 1, 1, 1, 1]
        # The algorithm keeps {Up, Down}, from the tick at 0.5 s on the command there and the item before it.
        assert rows[:, 5].tolist() == [0.5] * 5
        assert rows[:, 6].tolist() == [3, 3, 2, 2, 2]
    model.close()


NAMES = ("follower", "level", "slow", "echo", "turns")
TIMES = np.linspace(0, 6, 61)


def simulated(
    build: Build, tolerance: float, *, exchange: bool = False, **values: float
) -> dict[str, Floats]:
    fmu = FmuModel(build("Stiff"), interface="model-exchange" if exchange else "co-simulation")
    found = fmu.simulate({}, values, Experiment(6.0, 0.1, NAMES, tolerance=tolerance))
    fmu.close()
    return {name: np.asarray(found[name]) for name in NAMES}


def echo() -> Floats:
    """Return what follows 1 until 0.5 s, then cos(t - 0.5), with a rate of 50 / s."""
    late = np.maximum(TIMES - 0.5, 0)
    start = 1 - np.exp(-50 * np.minimum(TIMES, 0.5))
    # e' = 50 (cos(s) - e), e(0) = start: the stationary part is a sine and a cosine.
    cosine, sine = 2500 / 2501, 50 / 2501
    driven = cosine * np.cos(late) + sine * np.sin(late)
    return np.asarray(np.where(TIMES < 0.5, start, driven + (start - cosine) * np.exp(-50 * late)))


@pytest.mark.parametrize("tolerance", [1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("rate", [1e3, 1e6])
def test_stiff_equations(build: Build, tolerance: float, rate: float) -> None:
    found = simulated(build, tolerance, rate=rate)
    assert found["follower"] == pytest.approx(np.cos(TIMES), abs=20 * tolerance)
    assert found["slow"] == pytest.approx(np.exp(-TIMES), abs=20 * tolerance)
    assert np.array_equal(found["turns"], np.minimum(np.floor(TIMES / np.log(2)), 3))
    assert found["echo"] == pytest.approx(echo(), abs=100 * tolerance)
    if rate == 1e6:
        # The level is where inflow and outflow balance, apart from the slow decay of the inflow.
        assert found["level"][1:30] == pytest.approx((0.1 * np.exp(-TIMES[1:30])) ** 2, rel=1e-3)


def test_the_other_interface_has_the_same_solution(build: Build) -> None:
    one, other = simulated(build, 1e-9), simulated(build, 1e-9, exchange=True)
    for name in NAMES:
        assert one[name] == pytest.approx(other[name], abs=1e-4), name
