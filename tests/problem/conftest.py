import shutil
from pathlib import Path

import pytest

from tests.problem.support import AT


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    shutil.copy(AT, tmp_path / "AT.fmu")
    return tmp_path
