import hashlib
import tomllib
from pathlib import Path

import pytest

from tests.systems.driving import ROOT

FMUS = sorted((ROOT / "fmus").glob("*.fmu"))


@pytest.mark.parametrize("path", FMUS, ids=lambda path: path.stem)
def test_validator_has_no_complaint(path: Path) -> None:
    from fmpy.validation import validate_fmu

    assert validate_fmu(str(path)) == []


def test_checksums_and_export_table_name_all_fmus() -> None:
    lines = (ROOT / "fmus" / "SHA256SUMS").read_text().splitlines()
    sums = {name: digest for digest, name in (line.split() for line in lines)}
    assert sums == {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in FMUS}
    table = tomllib.loads((ROOT / "modelica" / "export" / "systems.toml").read_text())
    assert {entry["file"] for entry in table.values()} == sums.keys()
