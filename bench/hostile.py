"""What do kills, damaged files, random replies, bad FMUs and full disks do to searches and their record?

    python -m bench.hostile --minutes 60               # as root, also disks that fill up

Every trial hurts something, goes on as a user would, and compares with what came out unhurt. Uses the public
functions and the command line only. Committed result: bench/hostile.md.
"""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from random import Random

from falsifier import (
    Budget,
    Experiment,
    FalsifierError,
    FmuModel,
    LLMSettings,
    Result,
    ScriptedChat,
    analysis,
    falsify,
    load_counterexample,
    resume,
)
from tests.fixtures.fmus.catalogue import FIXTURES
from tests.hostile.damage import DAMAGES
from tests.hostile.servers import completion, misbehaving, response, sends

SAME, ONE_LINE, TRACEBACK, OTHER = OUTCOMES = ("as unhurt", "one clear line", "traceback", "other result")
FMUS = Path(__file__).parents[1] / "tests" / "fixtures" / "fmus"
COMMAND = [sys.executable, "-c", "from falsifier.cli import main; main()"]
QUIET = ("--engine", "uniform", "--budget", "30", "--quiet")
# After this time in s a command hangs; long, because the trials run beside other work.
PATIENCE = 1200.0
# A search that finds a counterexample after 18 simulations, one that finds none, and a short campaign.
SEARCHES = {
    "found": ("run", "AT2", "--seed", "2", *QUIET),
    "stands": ("run", "AT51", "--seed", "1", *QUIET),
    "campaign": ("bench", "AT2", "AT51", "--runs", "2", *QUIET),
}
GOOD_REPLY = json.dumps(
    {
        "rationale": "full throttle",
        "signals": [
            {"name": "throttle", "values": [90, 95, 99, 1, 2, 3, 4]},
            {"name": "brake", "values": [0, 1, 2]},
        ],
    }
)
PIECES = (
    *("<think>", "</think>", "```json\n", "{", "}", "[", "]", '"', ",", "9" * 6000, "1 x 111", "NaN"),
    *(
        "\x1b[2J",
        "\ud800",
        "\0",
        "null",
        "-",
        '{"signals": ',
        '"values": [1e999]',
        "\\u0000",
        "é",
        GOOD_REPLY,
    ),
)


class Other(Exception):
    """The outcome differs from the unhurt one."""


def run_outcome(result: Result) -> tuple[object, ...]:
    """What must not change: everything but times."""
    seen = [(e.candidate.key, e.status, e.robustness, e.verdict) for e in result.evaluations]
    found = result.counterexample
    return result.status, result.reason, seen, found and (found.outcome, found.robustness, found.reference)


def campaign_outcome(place: Path) -> list[tuple[object, ...]]:
    """The same of the runs of a campaign."""
    return [
        (
            r.directory.name,
            r.status,
            r.reason,
            r.simulations,
            r.robustness.tolist(),
            r.counterexample,
            r.verdict,
        )
        for r in analysis.load(place)
    ]


def command(*arguments: str, limit: float = PATIENCE) -> tuple[int, str]:
    """Run the command line; return its exit code and what it said on stderr."""
    done = subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=limit, check=False)
    if "Traceback" in done.stderr or "defect of falsifier" in done.stderr:
        raise RuntimeError(f"{arguments}\n{done.stderr}")
    return done.returncode, done.stderr


def refused(text: str) -> None:
    """Check that an error is one clear line."""
    if not text.strip() or "\n" in text.strip() or len(text) > 2100:
        raise Other(f"not one clear line: {text[:300]!r}")


def must_equal(found: object, wanted: object, what: str) -> None:
    """Check an outcome."""
    if found != wanted:
        raise Other(f"{what}: {str(found)[:300]} instead of {str(wanted)[:300]}")


@cache
def unhurt(kind: str) -> Path:
    """Return a folder with what comes out if nothing is hurt."""
    place = Path(tempfile.mkdtemp(prefix=f"hostile-{kind}-")) / "whole"
    if kind == "led":
        falsify("AT51", llm=ScriptedChat(answer), budget=8, directory=place)
    else:
        command(*SEARCHES[kind], "--out", str(place))
    return place


def answer(asked: object) -> str:
    """Reply to a prompt in the same way whenever it is asked."""
    random = Random(str([message.content for message in asked.messages]))  # type: ignore[attr-defined]
    signals = {
        "throttle": [random.randint(0, 100) for _ in range(7)],
        "brake": [random.randint(0, 300) for _ in range(3)],
    }
    return json.dumps({"rationale": "so", "signals": [{"name": n, "values": v} for n, v in signals.items()]})


def resumed(place: Path, kind: str) -> tuple[object, ...] | list[tuple[object, ...]]:
    """Continue a record and return its outcome."""
    if kind == "campaign":
        code, said = command("resume", str(place), "--quiet")
        if code == 2:
            raise FalsifierError(said.strip())
        return campaign_outcome(place)
    return run_outcome(resume(place, chat=ScriptedChat(answer) if kind == "led" else None)[0])


@cache
def wanted(kind: str) -> tuple[object, ...] | list[tuple[object, ...]]:
    """Return the unhurt outcome."""
    copy = unhurt(kind).with_name("copy")
    shutil.copytree(unhurt(kind), copy)
    return resumed(copy, kind)


# The classes of trials: each returns an outcome, or raises an error.


def kill(random: Random, place: Path, kind: str) -> str:
    """Kill a search or a campaign at random moments, up to five times; then let it end."""
    first = [*SEARCHES[kind], "--out", str(place)]
    if kind == "campaign":
        first += ["--jobs", str(random.choice((1, 2)))]
    for attempt in range(random.randint(1, 5)):
        begun = (place / "manifest.json").exists() or (place / "campaign.json").exists()
        arguments = ["resume", str(place), "--quiet"] if begun else first
        if attempt and not begun:
            shutil.rmtree(place, ignore_errors=True)
        process = subprocess.Popen(
            [*COMMAND, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )
        time.sleep(random.uniform(0.2, 3.0 if kind != "campaign" else 8.0))
        victim = (
            random.choice([process.pid, *children(process.pid)]) if random.random() < 0.3 else process.pid
        )
        with suppress(ProcessLookupError):
            os.kill(victim, random.choice((signal.SIGKILL, signal.SIGKILL, signal.SIGINT, signal.SIGTERM)))
        if victim != process.pid:
            time.sleep(random.uniform(0.0, 2.0))
            process.kill()
        _, said = process.communicate(timeout=PATIENCE)
        if "Traceback" in said or "defect of falsifier" in said:
            raise RuntimeError(said)
    if not (place / "manifest.json").exists() and not (place / "campaign.json").exists():
        shutil.rmtree(place, ignore_errors=True)
        command(*first)
    must_equal(resumed(place, kind), wanted(kind), "after kills")
    return SAME


def children(pid: int) -> list[int]:
    """Children of a process."""
    try:
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def damage(random: Random, place: Path, kind: str) -> str:
    """Damage any file of a record; resume; if that is refused, `tools repair` and resume."""
    shutil.copytree(unhurt(kind), place)
    files = sorted(p for p in place.rglob("*") if p.is_file() and p.stat().st_size)
    suffix = random.choice((".jsonl", ".jsonl", *{p.suffix for p in files}))
    path = random.choice([p for p in files if p.suffix == suffix] or files)
    for _ in range(random.choice((1, 1, 3))):
        path.write_bytes(random.choice(DAMAGES)(path.read_bytes() or b"\0", random))
    what = f"{path.relative_to(place)} damaged"
    try:
        must_equal(resumed(place, kind), wanted(kind), what)
        if path.name == "counterexample.json":
            must_equal(
                load_counterexample(path), load_counterexample(unhurt(kind) / path.relative_to(place)), what
            )
        return SAME
    except FalsifierError as error:
        refused(str(error))
    if path.name == "counterexample.json":
        return ONE_LINE
    code, said = command("tools", "repair", str(place))
    if code:
        refused(said)
        return ONE_LINE
    try:
        must_equal(resumed(place, kind), wanted(kind), f"{what} and repaired")
    except FalsifierError as error:
        refused(str(error))
    return ONE_LINE


def reply(random: Random, place: Path, kind: str) -> str:
    """Let a language model, or its server, answer with anything; the budget holds and a result comes out."""

    def text() -> str:
        return "".join(
            random.choice(PIECES) * random.choice((1, 1, 1, 300)) for _ in range(random.randint(0, 30))
        )

    if kind == "model":
        chat = ScriptedChat(lambda _: GOOD_REPLY if random.random() < 0.3 else text())
        result = falsify("AT51", llm=chat, budget=6, directory=place)
        must_equal(run_outcome(resume(place, chat=chat)[0]), run_outcome(result), "resumed")
        return SAME

    def mangled() -> bytes:
        content = response(completion(text() if random.random() < 0.5 else GOOD_REPLY))
        return random.choice(DAMAGES)(content, random) if random.random() < 0.5 else content

    with misbehaving(*(sends(mangled()) for _ in range(30))) as server:
        settings = LLMSettings(name="openai/any", api_base=server.url)
        started = time.monotonic()
        try:
            falsify("AT51", llm=settings, budget=Budget(6, seconds=4.0), directory=place)
        finally:
            if time.monotonic() - started > 30:
                raise Other("the limit of 4 s took 30 s")
    return SAME


@cache
def model_of(name: str) -> FmuModel:
    """A test FMU that misbehaves."""
    return FmuModel(FMUS / f"{name}.fmu", "model-exchange" if name.startswith("Wild") else "co-simulation")


def fmu(random: Random, place: Path, kind: str) -> str:
    """Let an FMU misbehave in one simulation; the next one is right."""
    names = [fixture.file for fixture in FIXTURES if fixture.name in kind.split()]
    model = model_of(random.choice(names))
    output = "x" if "Wild" in kind else "y"

    def simulate(misdeed: int) -> list[float]:
        parameters = {
            "misdeed": float(misdeed),
            "moment": random.choice((0.0, 0.5, 0.95)) if misdeed else 0.5,
        }
        experiment = Experiment(1.0, 0.1, (output,), None, None, 1.0)
        return [round(float(v), 6) for v in model.simulate({}, parameters, experiment)[output]]

    right = [round(0.1 * k, 6) if output == "x" else float(k) for k in range(11)]
    misdeed, outcome = random.randrange(1, 27 if output == "x" else 12), SAME
    try:
        simulate(misdeed)
    except FalsifierError as error:
        outcome = ONE_LINE
        refused(str(error))
    must_equal(simulate(0), right, f"{model.info.name} after misdeed {misdeed}")
    return outcome


@contextmanager
def disk(mib: float) -> Iterator[Path]:
    """A file system that fills up, and what makes room on it."""
    place = Path(tempfile.mkdtemp(prefix="hostile-disk-"))
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={int(mib * 1024)}k", "tmpfs", place], check=True)
    try:
        yield place
    finally:
        subprocess.run(["umount", "-l", place], check=True)
        place.rmdir()


def full_disk(random: Random, place: Path, kind: str) -> str:
    """Let the disk fill up while a record is written; make room; resume."""
    outcome = SAME
    with disk(random.uniform(0.004, 0.3)) as folder:
        target = folder / "run"
        first = [*SEARCHES[kind], "--out", str(target)]
        code, said = command(*first)
        if code not in (0, 1):
            outcome = ONE_LINE
            if code != 3 and "No space" not in said:
                raise Other(f"exit code {code}: {said[:300]}")
        subprocess.run(["mount", "-o", "remount,size=100m", folder], check=True)
        if not any((target / name).exists() for name in ("manifest.json", "campaign.json")):
            shutil.rmtree(target, ignore_errors=True)
            command(*first)
        must_equal(resumed(target, kind), wanted(kind), f"after a full disk ({said[:200]})")
    return outcome


Trial = Callable[[Random, Path, str], str]
CLASSES: dict[str, tuple[Trial, str, int]] = {
    "run with a counterexample, killed 1 to 5 times": (kill, "found", 1),
    "run without one, killed 1 to 5 times": (kill, "stands", 1),
    "campaign on 1 or 2 processes, killed 1 to 5 times": (kill, "campaign", 1),
    "damage to a run with a counterexample": (damage, "found", 15),
    "damage to a run without one": (damage, "stands", 15),
    "damage to a run that a language model leads": (damage, "led", 15),
    "damage to a campaign": (damage, "campaign", 1),
    "random replies of a language model": (reply, "model", 15),
    "random responses of a server": (reply, "server", 2),
    "misbehaving FMU, co-simulation 1, 2 and 3": (fmu, "Misdeeds", 20),
    "FMU that attacks its surroundings, 1, 2 and 3": (fmu, "Hostile", 10),
    "misbehaving FMU, model exchange 1, 2 and 3": (fmu, "Wild", 20),
    "disk that fills up under a run": (full_disk, "found", 1),
    "disk that fills up under a campaign": (full_disk, "campaign", 1),
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="classes whose name contains this")
    options = parser.parse_args()
    os.environ["OPENAI_API_KEY"] = "sk-hostile-bench-0000"
    random = Random(options.seed)
    counts: dict[str, Counter[str]] = {name: Counter() for name in CLASSES if options.only in name}
    if os.getuid():
        counts = {name: count for name, count in counts.items() if "disk" not in name}
    end = time.monotonic() + 60 * options.minutes
    tempfile.tempdir = folder = tempfile.mkdtemp(prefix="falsifier-hostile-")
    try:
        while time.monotonic() < end:
            for name, count in counts.items():
                trial, kind, number = CLASSES[name]
                for _ in range(number):
                    count[attempted(trial, kind, random, name)] += 1
            print(table(counts), file=sys.stderr, flush=True)
    finally:
        # FMUs leave folders that are nested too deeply for shutil.rmtree.
        subprocess.run(["rm", "-rf", folder], check=False)
    print(table(counts))


def attempted(trial: Trial, kind: str, random: Random, name: str) -> str:
    """Carry out one trial; return its outcome, and say on stderr what was wrong."""
    place = Path(tempfile.mkdtemp())
    try:
        return trial(random, place / "record", kind)
    except Other as error:
        print(f"{name}: {error}", file=sys.stderr, flush=True)
        return OTHER
    except FalsifierError as error:
        if "\n" not in str(error):
            return ONE_LINE
        print(f"{name}: {error}", file=sys.stderr, flush=True)
        return OTHER
    except Exception:
        print(f"{name}: {traceback.format_exc()[-3000:]}", file=sys.stderr, flush=True)
        return TRACEBACK
    finally:
        shutil.rmtree(place, ignore_errors=True)


def table(counts: dict[str, Counter[str]]) -> str:
    """Return the counts as a Markdown table."""
    lines = [f"| class | trials | {' | '.join(OUTCOMES)} |", "|---|" + "---:|" * (len(OUTCOMES) + 1)]
    for name, count in counts.items():
        cells = (count.total(), *(count[outcome] for outcome in OUTCOMES))
        lines.append(f"| {name} | {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
