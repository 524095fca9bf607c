from dataclasses import replace
from pathlib import Path

import pytest

from falsifier.context.values import Context, Named
from falsifier.core.files import bundled
from falsifier.errors import SpecError
from falsifier.problem.context import named_context, with_context
from falsifier.problem.loading import load_source
from falsifier.problem.source import ProblemSource
from falsifier.problem.spec import parse_spec

SPEC = {
    "model": {"fmu": "a.fmu"},
    "context": {"files": ["plant.mo"], "fmu": True, "checked": ["plant.mo", "a.fmu: sources/a.c"]},
    "requirements": {"R": {"formula": "G (y < 1)"}},
}
LIMP = bundled("fmus").parent / "modelica" / "Faults" / "HeaterLimpHome.mo"


def test_the_spec_and_the_options_name_context(tmp_path: Path) -> None:
    spec, path = parse_spec(SPEC, file="a.toml"), tmp_path / "a.toml"
    plain = ProblemSource(target="a.toml")
    inside = str(tmp_path / "plant.mo")
    checked = (inside, "a.fmu: sources/a.c")
    assert named_context(plain, spec, path) == Named((inside,), fmu=True, checked=checked)
    more = plain.model_copy(update={"context": ("b.md", "b.md", "checked:b.md")})
    assert named_context(more, spec, path) == Named((inside, "b.md"), fmu=True, checked=(*checked, "b.md"))
    assert not named_context(plain.model_copy(update={"context": ("none",)}), spec, path)
    assert named_context(plain.model_copy(update={"context": ("none", "fmu")}), spec, path) == Named(fmu=True)


def test_files_are_read_only_when_asked_for() -> None:
    problem = load_source(ProblemSource(target="HeaterLimpHome", context=("no such file",)))
    assert problem.context == Context()
    with pytest.raises(SpecError, match="context no such file: cannot be read"):
        with_context(problem)
    read = with_context(load_source(ProblemSource(target="HeaterLimpHome", context=(str(LIMP),))))
    assert "disagreement > enterAbove (enterAbove = 6.8)" in read.context.of("disagreement")
    # What was read once, or recorded, is not read again.
    assert with_context(replace(problem, context=read.context)).context == read.context
