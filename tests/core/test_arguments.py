import math

import numpy as np
import pytest

from falsifier.core.arguments import finite, one_of, positive, whole
from falsifier.errors import SpecError


@pytest.mark.parametrize("given", [2.5, "10", True, 0, -1, None, np.bool_(True), np.array([1, 2])])
def test_what_is_no_whole_number_is_refused(given: object) -> None:
    with pytest.raises(SpecError, match="jobs: expected a whole number, at least 1, got"):
        whole("jobs", given, least=1)


def test_numbers_of_numpy_become_those_of_python() -> None:
    assert type(whole("seed", np.int64(3), least=0)) is int
    assert [type(finite("low", x)) for x in (np.float32(-0.5), np.int64(3), 2)] == [float] * 3


@pytest.mark.parametrize("given", [math.nan, math.inf, -math.inf, "1", None, True, 1j])
def test_what_is_no_finite_number_is_refused(given: object) -> None:
    with pytest.raises(SpecError, match="low: expected a finite number, got"):
        finite("low", given)


@pytest.mark.parametrize("given", [0, -1e-300, -3])
def test_what_is_not_positive_is_refused(given: object) -> None:
    with pytest.raises(SpecError, match="hold: expected a positive number, got"):
        positive("hold", given)


def test_allowed_words_are_listed() -> None:
    one_of("interpolation", "linear", ("pchip", "linear", "constant"))
    with pytest.raises(SpecError, match="interpolation: expected pchip, linear or constant, got 'cubic'"):
        one_of("interpolation", "cubic", ("pchip", "linear", "constant"))
