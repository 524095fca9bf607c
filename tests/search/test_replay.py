import shutil
from pathlib import Path

import pytest

from falsifier.engines import make_engine
from falsifier.errors import JournalError
from falsifier.search.journal import read_journal
from falsifier.search.run import resume
from falsifier.testing import lag_problem
from tests.search.support import run


@pytest.mark.parametrize("engine", ["uniform", "corners", "sobol"])
@pytest.mark.parametrize("keep", [1, 8, 17])
def test_resume_from_any_line_gives_the_uninterrupted_run(tmp_path: Path, engine: str, keep: int) -> None:
    problem = lag_problem("G[0,10] (x <= 2)")
    whole = run(problem, tmp_path / "whole", engine=engine)
    lines = (tmp_path / "whole" / "journal.jsonl").read_bytes().splitlines(keepends=True)
    cut = tmp_path / "cut"
    shutil.copytree(tmp_path / "whole", cut)
    torn = lines[keep][: len(lines[keep]) // 2]
    (cut / "journal.jsonl").write_bytes(b"".join(lines[:keep]) + torn)
    resumed = run(problem, cut, engine=engine)
    assert [(e.candidate.key, e.robustness) for e in resumed.evaluations] == [
        (e.candidate.key, e.robustness) for e in whole.evaluations
    ]
    kinds = [r.kind for r in read_journal(cut)]
    assert kinds.count("evaluated") == 20
    assert kinds.count("asked") == 20


def test_resume_with_another_seed_is_refused(tmp_path: Path) -> None:
    problem = lag_problem("G[0,10] (x <= 2)")
    run(problem, tmp_path, budget=3)
    with pytest.raises(JournalError, match="candidate 0 of the engine 'uniform' differs from the journal"):
        resume(tmp_path, problems=[problem], engine=make_engine("uniform", problem, seed=2))
