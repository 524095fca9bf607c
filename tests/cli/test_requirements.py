import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from falsifier.analyses.formalize import Formalized
from falsifier.cli.requirements import _write
from falsifier.problem.loading import load_problem
from falsifier.problem.spec import read_spec
from falsifier.problem.writing import subject_of
from falsifier.search.budget import Spent
from tests.analyses.test_lint import SPEC
from tests.cli.support import ENV
from tests.command import falsifier
from tests.fmu.fixtures import path as fixture
from tests.llm.server import Server, Step, serving
from tests.problem.support import AT, spec

WIDE = SPEC + "[requirements.R]\nformula = 'G[0,20] (throttle <= 100)'\n"


def test_check_prints_requirement_place_and_what_to_do(tmp_path: Path) -> None:
    done = falsifier("check", spec(tmp_path, WIDE), cwd=tmp_path, code=1)
    assert "R: always: no trajectory in range violates it" in done.out
    assert "  in      G[0,20] (throttle <= 100)" in done.out
    assert "  to do   check threshold" in done.out
    found = falsifier("check", "my.toml", "--json", cwd=tmp_path, code=1)
    assert [(f["kind"], f["part"]) for f in found.json] == [("always", "G[0,20] (throttle <= 100)")]  # type: ignore[index]


def test_check_says_what_is_searched(tmp_path: Path) -> None:
    repeated = falsifier("check", "AT", cwd=tmp_path)
    assert repeated.code == 1, "AT6abc repeats others"
    assert repeated.out.count(": ok") == 10
    done = falsifier("check", "CC1", cwd=tmp_path, code=0)
    assert done.out.startswith("CC1: ok, ") and done.out.endswith("nothing found\n")
    shutil.copy(fixture("Echo_3"), tmp_path / "echo.fmu")
    searched = "[inputs.in_Enumeration]\n[requirements.R]\nformula = 'G (out_Int8 <= 3)'\n"
    (tmp_path / "echo.toml").write_text(f'[model]\nfmu = "echo.fmu"\ninterface = "co-simulation"\n{searched}')
    done = falsifier("check", "echo.toml", cwd=tmp_path)
    assert "in_Enumeration [1 = first, 3 = third]" in done.out and "in_Boolean = 0 (false)" in done.out
    drive = '[parameters.finalDrive]\nrange = [3, 3.5]\nscale = "log"\n'
    done = falsifier("check", spec(tmp_path, WIDE + drive), cwd=tmp_path)
    assert "finalDrive [3, 3.5] in decades" in done.out
    narrow = "[parameters.finalDrive]\nrange = [3.2300001, 3.2300002]\n"
    done = falsifier("check", spec(tmp_path, WIDE + narrow), cwd=tmp_path)
    assert "finalDrive [3.2300001, 3.2300002]" in done.out


GOOD = {
    "formula": "G[0,20] (speed <= 120)",
    "meaning": "never fast",
    "units": [{"signal": "speed", "unit": "mph"}],
    "satisfied": [{"name": "speed", "times": [0, 50], "values": [0, 0]}],
    "violated": [{"name": "speed", "times": [0, 50], "values": [300, 300]}],
}
REPLY = Step(json.dumps({"readings": [GOOD]}))
SENTENCE = "The speed stays below 120 mph for 20 s."


def asked(server: Server, model: str) -> list[str]:
    llm = ("--llm", "openai/gpt-5-mini", "--api-base", server.url, "--llm-option", "price=1:2")
    return ["formalize", model, SENTENCE, *llm]


def test_a_sentence_becomes_a_requirement_of_the_spec(tmp_path: Path) -> None:
    spec(tmp_path, WIDE)
    with serving(REPLY) as server:
        shown = falsifier(*asked(server, "my.toml"), cwd=tmp_path, env=ENV)
        done = falsifier(*asked(server, "my.toml"), "--choose", "1", cwd=tmp_path, env=ENV)
        assert len(server.received) == 1  # the second time from the cache
    assert (shown.code, shown.err) == (0, f"asking openai/gpt-5-mini at {server.url}\n")
    assert (
        "1. G[0,20] (speed <= 120)\n   in words   At all times from 0 to 20 s, speed is at most 120."
        in shown.out
    )
    assert "nominal    robustness +" in shown.out
    assert "language model: 1 request, 120 tokens (12 for reasoning), 0.0001 US dollars" in shown.out
    assert "--choose N" in shown.out
    assert done.code == 0, done.err
    assert "my.toml: requirement R1 written; to search: falsifier run my.toml:R1" in done.out
    (tmp_path / "other").mkdir()
    with serving(REPLY) as server:
        again = [*asked(server, "my.toml"), "--choose", "1", "--out", "other/new.toml"]
        moved = falsifier(*again, cwd=tmp_path, env=ENV)
    assert "other/new.toml: requirement R2 written" in moved.out, moved.err
    assert load_problem(str(tmp_path / "other" / "new.toml:R2")).model.path.is_file()  # type: ignore[attr-defined]
    problem = load_problem(str(tmp_path / "my.toml:R1"))
    assert (str(problem.requirement.formula), problem.requirement.description) == (GOOD["formula"], SENTENCE)


def test_what_is_edited_while_the_model_is_asked_is_kept(tmp_path: Path) -> None:
    path = Path(spec(tmp_path, WIDE))
    subject = subject_of(str(path))
    path.write_text(f"# mine\n{WIDE}")
    reading: Any = SimpleNamespace(formula=GOOD["formula"])
    found = Formalized(SENTENCE, subject, (reading,), (), (), Spent())
    assert _write(found, 1, None) == (str(path), "R1")
    assert path.read_text().startswith("# mine\n") and "R1" in read_spec(path).requirements


def test_an_fmu_gets_a_spec(tmp_path: Path) -> None:
    shutil.copy(AT, tmp_path / "car.fmu")
    with serving(REPLY) as server:
        done = falsifier(*asked(server, "car.fmu"), "--choose", "1", cwd=tmp_path, env=ENV)
    assert done.code == 0, done.err
    assert "car.toml: requirement R1 written" in done.out
    with serving(REPLY) as server:
        again = falsifier(*asked(server, "car.fmu"), "--choose", "1", cwd=tmp_path, env=ENV)
        assert not server.received, "said before anything is paid for"
        other = falsifier(
            *asked(server, "car.fmu"), "--choose", "1", "--out", "b.toml", cwd=tmp_path, env=ENV
        )
    assert (again.code, "car.toml already exists" in again.err) == (2, True)
    assert (other.code, (tmp_path / "b.toml").is_file()) == (0, True), other.err
    assert str(load_problem(str(tmp_path / "car.toml")).requirement.formula) == GOOD["formula"]


def test_wrong_choices_are_errors(tmp_path: Path) -> None:
    spec(tmp_path, WIDE)
    with serving(REPLY) as server:
        bundled = falsifier(*asked(server, "AT1"), "--choose", "1", cwd=tmp_path, env=ENV)
        taken = falsifier(*asked(server, "AT1"), "--out", "my.toml", cwd=tmp_path, env=ENV)
        nowhere = falsifier(*asked(server, "my.toml"), "--out", "no/my.toml", cwd=tmp_path, env=ENV)
        assert not server.received, "said before anything is paid for"
        second = falsifier(*asked(server, "my.toml"), "--choose", "2", cwd=tmp_path, env=ENV)
    assert {bundled.code, taken.code, nowhere.code, second.code} == {2}
    assert "no/my.toml" in nowhere.err
    assert "--out" in bundled.err
    assert "my.toml already exists: choose another --out" in taken.err
    assert "--choose 2: expected 1 to 1" in second.err


def test_without_a_language_model_the_templates_are_named(tmp_path: Path) -> None:
    done = falsifier("formalize", "AT1", SENTENCE, cwd=tmp_path)
    assert (done.code, done.out, done.err.count("\n")) == (2, "", 1)
    assert "--llm NAME" in done.err and "settles" in done.err
