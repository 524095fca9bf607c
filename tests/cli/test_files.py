import json
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from falsifier.cli.files import write_counterexample
from falsifier.counterexamples.store import load
from falsifier.evaluation.confirm import confirm
from falsifier.evaluation.evaluate import evaluate
from falsifier.testing import lag_problem
from tests.pictures import CRITICAL, INPUT, OUTPUT, colours

PROBLEM = lag_problem()
FOUND = confirm(PROBLEM, evaluate(PROBLEM, PROBLEM.space.decode([1.0] * 4)))


def test_a_counterexample_is_a_file_with_its_picture_beside_it(tmp_path: Path) -> None:
    data, picture = write_counterexample(FOUND, tmp_path / "run")
    assert load(data).robustness == FOUND.evaluation.robustness
    assert data == tmp_path / "run" / "counterexample.json"
    assert picture == data.with_suffix(".png")
    assert {OUTPUT, INPUT, CRITICAL} <= colours(picture)


def test_the_picture_is_named_and_titled_like_the_counterexample(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    titles: list[str] = []

    def keep(figure: Figure, path: Path) -> None:
        titles.append(figure.get_suptitle())

    monkeypatch.setattr("falsifier.views.plotting.save_figure", keep)
    files = write_counterexample(FOUND, tmp_path, name="fragile-1.json")
    assert [f.name for f in files] == ["fragile-1.json", "fragile-1.png"]
    assert json.loads(files[0].read_text())["outcome"] == "confirmed"
    assert titles[0].startswith("LAG: x <= 0.9 was violated from")
    assert f"robustness {FOUND.evaluation.robustness:+.5g}" in titles[0]
