import shlex
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path

import click
import pytest

from falsifier.cli import cli
from falsifier.cli.command import Command, option_groups
from falsifier.core.files import bundled
from falsifier.engines import ENGINES
from tests.command import ROOT, commands, falsifier


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "AT1", "--stl", "G[0,20] (sped <= 120)"], "did you mean 'speed'"),
        (["run", "AT1", "--search", "throtle=0:100:7"], "did you mean 'throttle'"),
        (["run", "AT1", "--budget", "0"], "--budget 0: expected a whole number from 1 to"),
        (["check", "AT1", "--budget", "-1"], "--budget -1: expected a whole number from 0 to"),
        (["explain", "run", "--map", "--budget", "99999999999"], "--budget 99999999999: expected a whole"),
        (["run", "AT1", "--seed", "1", "--seed=2"], "--seed: given 2 times; give one"),
        (["info", "python:tests.problems:easy"], "bundled name, not a problem made in Python"),
        (["init", ""], "an argument is empty"),
        (["run", "AT1", "--out", ""], "--out: the value is empty"),
        (["run", "AT1:R1"], "no requirement 'R1': AT1 is itself a requirement, of AT"),
        (["run", "AT1:AT1:x"], "no requirement 'AT1:x'"),
        (["run", "python:json:dumps"], "dumps() raised TypeError: dumps() missing 1 required"),
        (["run", "python:gone_module:problem"], "start the command line with python -m falsifier"),
        (["run", "python:tests.problems:gone"], "expected python:MODULE:NAME that can be imported"),
        (["run", "pr\udce9f.toml:R"], "pr\\xe9f.toml:R: the name is not valid UTF-8; rename the file"),
        (["check", "m\udce9.fmu", "--stl", "x <= 1"], "m\\xe9.fmu: the name is not valid UTF-8"),
        (["run", "AT1", "--context", "\udce9.md"], "\\xe9.md: the name is not valid UTF-8"),
        (["init", "AT.fmu", "--out", "gone/x.toml"], "no such folder gone"),
        (["tools", "build", "AT", "--out", "/dev/null"], "/dev/null is not a file that can be replaced"),
        (["simulate", "AT1", "--out", "/dev/null"], "/dev/null: no folder can be made here (N"),
        (["bench", "AT1", "--out", "/dev/null"], "/dev/null: no folder can be made here (N"),
        (["run", "AT1", "--allow", "foo"], "falsifier: --allow: unknown 'foo'; known: write:PATH"),
        (["init", "my.toml"], "is a spec, not an FMU"),
        (["explain", "."], "not a run directory; expected a counterexample file"),
        (["coverage", "."], ".: not a run directory"),
        (["run", "AT1", "--stl", "x <= 1", "--stl", "x <= 2"], "--stl: given 2 times"),
        (["coverage", "gone"], "gone: no such directory; expected that of a run"),
        (["assess", "."], ".: not a run directory: it contains no manifest.json; expected"),
        (["run", "AT1", "--llm", "openai/x@hgih"], "unknown effort 'hgih'; did you mean 'high'?"),
        (["margin", "AT1", "--stl", "G (speed <= {limit})", "--between", "nan:1"], "expected LOW:HIGH"),
        (["run", "AT1", "--set", "throttle=nan"], "--set throttle: expected a number, got 'nan'"),
        (["run", "AT1", "--seconds", "0"], "--seconds 0: expected a positive number"),
        (["run", "AT1", "--max-cost", "nan"], "--max-cost nan: expected a positive number"),
        (["run", "AT1", "--max-tokens", "0"], "--max-tokens 0: expected a whole number from 1 on"),
        (["bench", "AT1", "--total", "seconds=0"], "cost=N (N > 0), for example cost=5"),
        (["bench", "AT1", "--total", "cost=1", "--total", "cost=5"], "--total: a limit is given twice"),
        (["run", "AT1", "--search", "throttle=100:0"], "falsifier: --search throttle: expected [low, high]"),
        (["run", "AT1", "--search", "throttle=0:nan"], "--search throttle: expected a number, got 'nan'"),
        (["run", "AT1", "--search", "throttle=0:500"], "falsifier: --search throttle: [0, 500] exceeds"),
        (["run", "AT1", "--set", "throttle=fifty"], "--set throttle: expected a number, got 'fifty'; to sea"),
        (["run", "AT1", "--set", "finalDrive=big"], "--search finalDrive=LOW:HIGH"),
        (["run", "AT1", "--set", "throtle=5"], "falsifier: --set throtle: the FMU has no input, parameter"),
        (["run", "AT1", "--stop-time", "1e-9"], "falsifier: --stop-time: stop_time = 1e-09 s is not"),
        (["run", "AT1", "--engine", "hybrid"], "name one (--llm NAME)"),
        (["run", "AT.fmu", "--stl", "settles signal=x"], "falsifier: --stl: reference: this key is missing"),
        (["simulate", "AT1", "--search", "throttle"], "No such option"),
        (["shrink", "r"], "use falsifier explain RUN --shrink"),
        (["schema"], "use falsifier tools schema"),
        (["run", "AT1", "--variant", "MP4"], "add --llm NAME"),
        (["run", "gone.toml"], "no such spec file"),
        (["report", "gone"], "gone: no such directory; expected that of a run or campaign"),
        (["report", "/dev/null"], "/dev/null: not a run or campaign directory"),
        (["resume", "nowhere"], "nowhere: no such directory"),
        (["info", "gone.fmu"], "gone.fmu: no such file"),
        (["rn", "AT1"], "did you mean 'run'"),
        (["run", "AT9"], "AT1, AT2, AT51, AT52"),
        (["run", "AT1", "--llm", "openai/gpt-5-mini"], "set OPENAI_API_KEY"),
        (["run", "AT1", "--llm", "gpt-5-mini"], "expected PROVIDER/MODEL"),
        (["bench", "AT1", "--llm", "openai/gpt-5-mini"], "set OPENAI_API_KEY"),
        (["bench", "AT1", "--engine", "corner"], "did you mean 'corners'"),
    ],
)
def test_wrong_usage_ends_with_two_and_says_what_to_do(
    tmp_path: Path, arguments: list[str], message: str
) -> None:
    done = falsifier(*arguments, cwd=tmp_path, code=2)
    assert message in done.err
    assert "Traceback" not in done.err and done.out == ""


def test_a_report_on_a_link_to_itself_says_that_nothing_is_there(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to("loop")
    assert "loop: no such directory" in falsifier("report", "loop", cwd=tmp_path, code=2).err


@pytest.mark.parametrize(
    "arguments", [["run"], ["coverage"], ["info"], ["run", "AT1", "--jobs"], ["run", "AT1", "--engine"]]
)
def test_of_a_very_long_argument_both_ends_are_told(arguments: list[str], tmp_path: Path) -> None:
    told = falsifier(*arguments, f"a{'x' * 9000}z", cwd=tmp_path, code=2).err
    assert "ax" in told and "xz" in told and len(told) < 2500


@pytest.mark.parametrize("command", [["run", "AT1"], ["run", "AT"], ["bench", "AT1"], ["simulate", "AT1"]])
def test_a_folder_with_files_is_kept(command: list[str], tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "mine").write_text("kept")
    refused = falsifier(*command, "--out", "out", cwd=tmp_path)
    assert "has files, which are kept: choose another --out" in refused.err


def test_files_whose_names_are_not_utf_8_are_told_before_anything_is_written(tmp_path: Path) -> None:
    shutil.copy(bundled("fmus") / "AT.fmu", tmp_path / "\udce9.fmu")
    (tmp_path / "\udce9.csv").write_text("time,throttle,brake\n0,10,0\n50,10,0\n")
    run = ("run", "AT1", "--out", "new", "--budget", "1")
    for arguments in (
        ("init", "\udce9.fmu", "--out", "new"),
        (*run, "--inputs", "\udce9.csv"),
        (*run, "--allow", "read:\udce9.csv"),
    ):
        assert "the name is not valid UTF-8; rename" in falsifier(*arguments, cwd=tmp_path, code=2).err
    assert not (tmp_path / "new").exists()
    ascii_names = {"LC_ALL": "C", "PYTHONUTF8": "0"}  # UTF-8 names are valid, and Python does not read them
    told = falsifier(
        "check", "ä.fmu", "--stl", "x <= 1", cwd=tmp_path, env=ascii_names, fresh=True, code=2
    ).err
    assert r"\xc3\xa4.fmu: the name is not valid ASCII; set PYTHONUTF8=1" in told


IMPORTED = """
import sys

before = set(sys.modules)  # what an environment's own .pth files import
from falsifier.cli import main

try:
    main()
finally:
    packages = {name.partition(".")[0] for name in set(sys.modules) - before} - sys.stdlib_module_names
    print(*sorted(packages), file=sys.stderr)
"""
# What takes long to import, and not all commands need.
SLOW = {"litellm", "matplotlib", "openai", "pandas", "pint", "rich", "rtamt", "scipy", "tomlkit"}


@pytest.mark.parametrize(
    ("arguments", "allowed"),
    [
        ("--help", {"click", "falsifier"}),
        ("run --help", {"click", "falsifier"}),
        ("bench --help", None),
        ("check AT1", None),
        ("info AT.fmu", None),
    ],
)
def test_commands_start_with_few_packages(arguments: str, allowed: set[str] | None) -> None:
    done = subprocess.run(
        [sys.executable, "-c", IMPORTED, *arguments.split()],
        env={"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    imported = set(done.stderr.split())
    assert imported <= allowed if allowed else not imported & SLOW


def test_what_several_commands_have_is_below_a_heading_of_help() -> None:
    helps = [option_groups(command, click.Context(command)) for _, command in commands(cli)]
    names = Counter(row[0].split()[0] for groups in helps for _, rows in groups for row in rows)
    own = [row[0].split()[0] for first, *more in helps for row in first[1] if more and first[0] == "Options"]
    assert own and not [name for name in own if names[name] > 1]


def test_the_engines_are_listed_in_every_command_that_takes_one() -> None:
    found = dict(commands(cli))
    for name in ("run", "bench", "margin"):
        (option,) = (p for p in found[name].params if isinstance(p, click.Option) and "--engine" in p.opts)
        listed = [*ENGINES] if name != "margin" else [e for e in ENGINES if e != "hybrid"]
        assert f"Search engine: {', '.join(listed)}. Default: surrogate" in (option.help or "")


def test_options_are_few_and_mean_the_same_everywhere() -> None:
    options: dict[str, set[str]] = {}
    for _, command in commands(cli):
        assert isinstance(command, Command), f"make {command.name} with cli.command.command"
        for option in (p for p in command.params if isinstance(p, click.Option)):
            options.setdefault(option.opts[-1], set()).add(option.type.name)
    assert 40 < len(options) <= 60
    assert not [name for name, types in options.items() if len(types) > 1]


@pytest.mark.parametrize(
    ("typed", "completed"),
    [("ru", "plain,run"), ("tools s", "plain,schema"), ("run --se", "plain,--seed"), ("run my", "file,my")],
)
def test_a_shell_completes_what_is_typed(typed: str, completed: str, tmp_path: Path) -> None:
    asked = {"_FALSIFIER_COMPLETE": "bash_complete", "COMP_WORDS": f"falsifier {typed}"}
    done = falsifier(cwd=tmp_path, env=asked | {"COMP_CWORD": str(len(typed.split()))}, code=0)
    assert completed in done.out.splitlines()


def test_a_closed_pipe_is_not_a_falsification(tmp_path: Path) -> None:
    program = f"{shlex.quote(sys.executable)} -c 'from falsifier.cli import main; main()'"
    command = program + " info AT.fmu | true; echo ${PIPESTATUS[0]}"
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"}
    done = subprocess.run(
        ["bash", "-c", command], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "141"
    assert "Traceback" not in done.stderr
