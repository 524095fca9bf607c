"""Run directories are plain files that keep to the exported JSON Schemas."""

import json
import re
from pathlib import Path

import jsonschema
import pytest
from click.testing import CliRunner

from falsifier.cli import cli
from falsifier.record.manifest import Manifest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "run-directory.md"


def schema(what: str) -> dict[str, object]:
    printed = CliRunner().invoke(cli, ["tools", "schema", what]).stdout
    assert not re.search(r'"(gt|ge|lt|le)":', printed)  # pydantic's names of limits, which schemas ignore
    loaded: dict[str, object] = json.loads(printed)
    jsonschema.Draft202012Validator.check_schema(loaded)
    return loaded


def test_every_line_of_every_journal_keeps_to_the_schema(campaign: Path) -> None:
    check = jsonschema.Draft202012Validator(schema("journal"))
    lines = [line for p in campaign.rglob("journal.jsonl") for line in p.read_text().splitlines()]
    assert {json.loads(line)["kind"] for line in lines} >= {"asked", "evaluated", "confirmed", "ended"}
    for line in lines:
        check.validate(json.loads(line))


def test_manifests_and_campaigns_keep_to_the_schema(campaign: Path) -> None:
    manifests = sorted(campaign.rglob("manifest.json"))
    assert len(manifests) == 8
    for path in manifests:
        jsonschema.validate(json.loads(path.read_text()), schema("manifest"))
    jsonschema.validate(json.loads((campaign / "campaign.json").read_text()), schema("campaign"))


def test_the_schema_refuses_what_is_no_record() -> None:
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"kind": "evaluated", "index": 0}, schema("journal"))


def test_the_page_names_every_file_and_every_kind_of_record(campaign: Path) -> None:
    page = PAGE.read_text(encoding="utf-8")
    kinds = schema("journal")["discriminator"]["mapping"]  # type: ignore[index]
    files = ("manifest.json", "journal.jsonl", "trajectories/", *(p.name for p in campaign.iterdir()))
    for name in (*kinds, *files):
        assert f"`{name}" in page, name
    fields = [f for d in schema("journal")["$defs"].values() for f in d.get("properties", {})]  # type: ignore[attr-defined]
    for field in (*fields, *Manifest.model_fields):
        assert f"`{field}`" in page, field
