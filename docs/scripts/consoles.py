"""Runs a page's console blocks and compares or rewrites their output, so that examples stay true.

    python docs/scripts/consoles.py docs/tutorial.md            run again and write the output into the page
    python docs/scripts/consoles.py --check docs/tutorial.md    fail where the page shows something else

A block ```` ```console ```` has commands after ``$ `` and what they print on stdout. A block with
``title="FILE"`` is written to that file first. All blocks of a page run in one new folder, with
``~/falsifier`` standing for this checkout. Numbers are compared to a thousandth, durations not at all.
"""

import math
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path
from shlex import quote

ROOT = Path(__file__).resolve().parents[2]
_BLOCK = re.compile(r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)
_CLOCK = re.compile(r"\(\d[\d.]* s; simulator \d[\d.]* s, engine \d[\d.]* s\)")
_NUMBER = re.compile(r"([-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?)")
_TOLERANCE = 1e-3
# A command that has not ended by then hangs, however busy the machine is.
_HANG_SECONDS = 1800


@dataclass(frozen=True)
class Difference:
    """A line that the page shows otherwise than the command prints it."""

    command: str
    shown: str
    printed: str


@dataclass(frozen=True)
class Done:
    """A finished command."""

    code: int
    out: str
    err: str


Execute = Callable[[str, Path, Mapping[str, str]], Done]


def in_shell(command: str, folder: Path, environment: Mapping[str, str]) -> Done:
    """Execute a command as a user does."""
    done = subprocess.run(
        ["sh", "-c", command],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=_HANG_SECONDS,
        check=False,
    )
    return Done(done.returncode, done.stdout, done.stderr)


def run(page: str, execute: Execute = in_shell) -> tuple[str, list[Difference]]:
    """Return the page with today's output, and where that differs.

    Args:
        page: the text.
        execute: executes a command in a folder with these variables.

    Raises:
        RuntimeError: if a command ends with a code other than 0 and 1 (falsified).
    """
    differences: list[Difference] = []
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder) / "work"
        work.mkdir()
        environment = _environment(Path(folder))

        def executed(block: re.Match[str]) -> str:
            language, title, text = block.groups()
            if title is not None:
                (work / title).write_text(text, encoding="utf-8")
            if language != "console":
                return block[0]
            today = []
            code = 0
            for command, shown in _commands(text):
                if command == "echo $?":
                    printed = f"{code}\n"
                else:
                    done = execute(command, work, environment)
                    if done.code not in (0, 1):
                        raise RuntimeError(f"{command}: exit code {done.code}\n{done.out}{done.err}")
                    code = done.code
                    printed = "".join(f"{line.rstrip()}\n" for line in done.out.splitlines())
                differences.extend(_compare(command, shown, printed))
                today.append(f"$ {command}\n{printed}")
            return f"```console\n{''.join(today)}```"

        return _BLOCK.sub(executed, page), differences


def _environment(folder: Path) -> dict[str, str]:
    """Variables under which ``falsifier`` and ``python`` are those of this checkout."""
    tools = folder / "bin"
    tools.mkdir()
    for name, module in (("python", ""), ("falsifier", "-m falsifier")):
        script = tools / name
        script.write_text(f'#!/bin/sh\nexec {quote(sys.executable)} {module} "$@"\n')
        script.chmod(0o755)
    (folder / "falsifier").symlink_to(ROOT)
    kept = {k: v for k, v in os.environ.items() if not k.endswith(("_API_KEY", "_TOKEN"))}
    path = f"{tools}{os.pathsep}{os.environ['PATH']}"
    return kept | {"PATH": path, "HOME": str(folder), "PYTHONPATH": str(ROOT), "COLUMNS": "110"}


def _commands(text: str) -> Iterator[tuple[str, str]]:
    """Commands of a block with what the page shows behind each."""
    for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:]:
        command, _, shown = part.partition("\n")
        while command.endswith("\\"):
            more, _, shown = shown.partition("\n")
            command += f"\n{more}"
        yield command, shown


def _compare(command: str, shown: str, printed: str) -> Iterator[Difference]:
    for one, other in zip_longest(shown.splitlines(), printed.splitlines(), fillvalue="(nothing)"):
        if not _alike(_CLOCK.sub("", one), _CLOCK.sub("", other)):
            yield Difference(command, one, other)


def _alike(one: str, other: str) -> bool:
    first, second = _NUMBER.split(one), _NUMBER.split(other)
    if first[::2] != second[::2]:
        return False
    pairs = zip(first[1::2], second[1::2], strict=True)
    return all(math.isclose(float(a), float(b), rel_tol=_TOLERANCE, abs_tol=_TOLERANCE) for a, b in pairs)


def main(arguments: list[str]) -> int:
    """Check or rewrite the pages; returns the exit code."""
    check = "--check" in arguments
    found = False
    for path in (Path(a) for a in arguments if a != "--check"):
        page, differences = run(path.read_text(encoding="utf-8"))
        found |= bool(differences)
        for d in differences:
            print(f"{path}: {d.command}\n  shown   {d.shown}\n  printed {d.printed}")
        if not check:
            path.write_text(page, encoding="utf-8")
    return 1 if check and found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
