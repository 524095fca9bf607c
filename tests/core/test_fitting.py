from dataclasses import replace

import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.fitting import fit
from falsifier.core.signals import Signal
from falsifier.core.space import Freedom
from falsifier.errors import CandidateError
from falsifier.testing import START, lag_problem

RAMP = Signal(tuple(i / 10 for i in range(101)), tuple(i / 100 for i in range(101)), "linear")


def test_what_fits_stays_as_it_is() -> None:
    space = lag_problem(points=3, parameters=[START]).space
    candidate = space.decode([0.1, 0.2, 0.3, 0.5])
    assert fit(space, candidate).candidate.key == candidate.key
    assert fit(space, candidate).notes == ()


def test_a_signal_is_sampled_at_the_control_points_of_the_spec() -> None:
    fitted = fit(lag_problem(points=3).space, Candidate({"u": RAMP}))
    assert fitted.candidate.signals["u"].values == pytest.approx((0, 0.5, 1))
    assert "u is sampled at 3 control points with linear interpolation" in fitted.notes[0]


def test_a_free_space_takes_as_many_control_points_as_it_allows() -> None:
    space = lag_problem(free=Freedom(max_control_points=50, min_interval=0.5)).space
    assert len(fit(space, Candidate({"u": RAMP})).candidate.signals["u"].times) == 21
    steps = Signal((0.0, 0.1), (0.0, 1.0), "constant")
    assert len(fit(space, Candidate({"u": steps})).candidate.signals["u"].times) == 20


def test_inputs_that_are_not_searched_are_left_out_and_said() -> None:
    fitted = fit(lag_problem().space, Candidate({"u": RAMP, "v": RAMP}))
    assert list(fitted.candidate.signals) == ["u"]
    assert any("v is not searched" in note for note in fitted.notes)


def test_a_missing_parameter_has_its_nominal_value_and_needs_one() -> None:
    space = lag_problem(points=1, parameters=[START]).space
    fitted = fit(space, Candidate({"u": Signal((0.0,), (0.5,), "linear")}))
    assert fitted.candidate.parameters == {"x0": 0.0}
    assert "x0 is not given" in fitted.notes[0]
    with pytest.raises(CandidateError, match="'x0' is searched and missing"):
        fit(
            replace(space, parameters=(replace(START, nominal=None),)),
            fitted.candidate.__class__({"u": RAMP}),
        )


def test_values_outside_the_range_and_missing_inputs_are_refused() -> None:
    space = lag_problem(points=2).space
    peak = Signal((0.0, 4.0, 5.0, 10.0), (0.0, 0.0, 1.5, 0.0), "linear")
    with pytest.raises(CandidateError, match=r"'u' at t = 5 s: 1.5 is outside its range \[-1, 1\]"):
        fit(space, Candidate({"u": peak}))
    with pytest.raises(CandidateError, match="'u' is searched and missing"):
        fit(space, Candidate())
