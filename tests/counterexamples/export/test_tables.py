from pathlib import Path

import pytest

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal
from falsifier.core.space import Freedom
from falsifier.counterexamples.export.inputs import input_table
from falsifier.counterexamples.export.tables import matlab_name, write_mat, write_ssv
from falsifier.testing import lag_problem


def test_the_ssv_is_valid_and_reads_back(tmp_path: Path) -> None:
    fmpy_ssd = pytest.importorskip("fmpy.ssp.ssd")
    path = write_ssv({"x.y[1]": 0.1 + 0.2, "phi<0": -1.5}, "A & B", tmp_path / "s.ssv")
    read = fmpy_ssd.read_ssv(str(path))  # validates against the schema of SSP 1.0
    assert read.name == "A & B"
    assert {p.name: float(p.value) for p in read.parameters} == {"x.y[1]": 0.1 + 0.2, "phi<0": -1.5}


def test_the_mat_file_holds_time_and_value_by_names_that_matlab_accepts(tmp_path: Path) -> None:
    from scipy.io import loadmat

    problem = lag_problem(free=Freedom(10, 0.1))
    table = input_table(problem, Candidate({"u": Signal((0.0, 5.0), (0.0, 1.0), "constant")}))
    content = loadmat(write_mat(table, {"a.b[2]": 3.0}, tmp_path / "i.mat"))
    assert content["u"].tolist() == [[0.0, 0.0], [5.0, 0.0], [5.0, 1.0], [10.0, 1.0]]
    assert content["start_values"]["a_b_2_"][0, 0].item() == 3.0
    assert [[cell.item() for cell in row] for row in content["names"]] == [["u", "u"], ["a_b_2_", "a.b[2]"]]
    assert matlab_name("1 x") == "x1_x"
