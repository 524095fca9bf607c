import pytest

from falsifier.fmu.isolation import REGISTRY
from tests.fmu.fixtures import isolated, run


@pytest.mark.parametrize(
    ("name", "reuse"),
    [
        ("Lag_2", "reset"),
        ("NoReset_2", "instance"),
        ("LyingReset_2", "instance"),
        ("SavedState_2", "state"),
        ("SavedState_3", "state"),
        ("LyingState_2", "instance"),
        ("SpentState_3", "instance"),
        ("KeepsStatic_2", "process"),
    ],
)
def test_repeated_runs_are_equal_whatever_the_reset_does(name: str, reuse: str) -> None:
    model = isolated(name)
    runs = [run(model, ("y",))["y"].tolist() for _ in range(4)]
    assert runs == [runs[0]] * 4
    (fmu,) = [f for key, f in REGISTRY._fmus.items() if key[0] == model.sha256]
    assert fmu._reuse == reuse
    model.close()
