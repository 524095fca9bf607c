from pathlib import Path

import pytest

from tests.fmu.support import FORKED, assert_nothing_is_left, script


@pytest.mark.parametrize("ending", ["", "go(1)", "os.kill(os.getpid(), 9)", "os._exit(3)"])
def test_folders_and_processes_are_gone_however_the_process_ends(tmp_path: Path, ending: str) -> None:
    with script("print('ran', flush=True)\n" + ending, TMPDIR=str(tmp_path)) as process:
        assert process.stdout is not None
        assert process.stdout.read() == "ran\n"
    assert_nothing_is_left(tmp_path)


@FORKED
def test_fmu_processes_see_no_secrets(tmp_path: Path) -> None:
    body = """
from falsifier.fmu.isolation import REGISTRY
(fmu,) = REGISTRY._fmus.values()
for pid in (fmu._worker.pid, REGISTRY._starter._process.pid):
    print(Path(f"/proc/{pid}/environ").read_text().replace(chr(0), chr(10)))
"""
    with script(
        body, SOME_API_KEY="hidden-1", GH="ghp_hidden2hidden2hidden2", LICENSE="port@host"
    ) as process:
        assert process.stdout is not None
        seen = process.stdout.read()
    assert "hidden" not in seen
    assert seen.count("LICENSE=port@host") == 2
