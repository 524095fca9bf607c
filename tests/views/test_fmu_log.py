from pathlib import Path

from falsifier import falsify
from falsifier.testing import lag_problem
from falsifier.views.fmu_log import FmuLog
from tests.problems import broken


def test_each_simulation_has_its_line_and_its_messages(tmp_path: Path) -> None:
    path = tmp_path / "new" / "fmu.txt"
    problem = lag_problem("G[0,10] (x <= 2)", response=broken)
    result = falsify(problem, "uniform", budget=6, seed=1, listeners=[FmuLog(path)])
    lines = [line for line in path.read_text().splitlines() if line.startswith("simulation ")]
    assert len(lines) == 6
    for line, evaluation in zip(lines, result.evaluations, strict=True):
        assert line.partition(": ")[2].startswith(evaluation.status)
        assert evaluation.reason in line
