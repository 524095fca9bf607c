"""How many simulations context saves, how long reading takes, and how many tokens it costs.

HeaterLimpHome shows its fault only if limp-home mode begins again within 1.5 s after it ended. A scripted
language model aims at these thresholds if its prompt tells them; the surrogate tries the crossings that the
files give. The Simulink files are the equivalent model of the tests.

    nice -n 15 python -m bench.context
    nice -n 15 python -m bench.context --seeds 0-4
"""

import argparse
import os
from pathlib import Path
from statistics import mean, median
from tempfile import TemporaryDirectory
from time import process_time

# For the engines' small matrices, threads of the linear algebra cost more than they save.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from bench.search import seeds_from
from falsifier import Result, falsify
from falsifier.context.gather import gather
from falsifier.engines.briefing import preview
from falsifier.llm.scripted import ScriptedChat
from falsifier.llm.usage import count_tokens
from falsifier.problem.loading import load_source
from falsifier.problem.source import ProblemSource
from tests.fixtures import limp_home, simulink

BUDGET = 1000
LINES = 10_000


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=seeds_from, default=range(10), help="for example 0-9")
    seeds = parser.parse_args().seeds
    print("| search | context | falsified | simulations: mean | median | largest | tokens of the prompt |")
    print("|---|---|---|---|---|---|---|")
    with TemporaryDirectory() as folder:
        files = (None, *_files(Path(folder)))
        for file in files:
            print(_surrogate(seeds, file), flush=True)
        for row in map(_scripted, files):
            print(row, flush=True)
        print(f"\n{_reading(Path(folder))}")


def _files(folder: Path) -> tuple[Path, ...]:
    slx, mdl, mo = folder / "limphome.slx", folder / "limphome.mdl", folder / "HeaterLimpHome.mo"
    simulink.write_slx(slx)
    mdl.write_text(simulink.MDL)
    mo.write_text(limp_home.SOURCE.read_text())
    return slx, mdl, mo


def _source(file: Path | None) -> ProblemSource:
    return ProblemSource(target="HeaterLimpHome", context=(str(file),) if file else ())


def _surrogate(seeds: range, file: Path | None) -> str:
    name = file.name if file else "none"
    results = [falsify(_source(file), "surrogate", budget=BUDGET, seed=seed) for seed in seeds]
    return _row("surrogate with context" if file else "surrogate", name, results, "")


def _scripted(file: Path | None) -> str:
    # Without thresholds it repeats itself, so one answer says all.
    budget = BUDGET if file else 1
    result = falsify(_source(file), llm=ScriptedChat(limp_home.reads_thresholds), budget=budget)
    sent = sum(count_tokens(m.content) for m in preview(load_source(_source(file))))
    return _row("scripted LLM", file.name if file else "none", [result], str(sent))


def _row(search: str, context: str, results: list[Result], tokens: str) -> str:
    spent = [r.spent.simulations for r in results]
    found = sum(r.status == "falsified" for r in results)
    return (
        f"| {search} | {context} | {found}/{len(results)} | {mean(spent):.1f} | {median(spent):g} | "
        f"{max(spent)} | {tokens} |"
    )


def _reading(folder: Path) -> str:
    """Return how long a long model takes, and what is left of it."""
    count = (LINES - 10) // 2
    lines = [f"  Real x{i};" for i in range(count)]
    equations = [f"  x{i} = if x{i - 1} > {i} then 1 else u;" for i in range(1, count)]
    head = "model Big\n  input Real u;\n  output Real y;\n  Real w;\n"
    text = head + "\n".join([*lines, "equation", *equations])
    path = folder / "big.mo"
    path.write_text(f"{text}\n  w = 2 * u;\n  y = if w > 7.25 then 1 else 0;\nend Big;\n")
    begin = process_time()
    (excerpt,) = gather([str(path)], [], seeds=["y"], signals=["y", "u"]).excerpts
    took = process_time() - begin
    return (
        f"A Modelica model of {len(path.read_text().splitlines())} lines took {took:.1f} s of processor "
        f"time; {len(excerpt.text.splitlines())} lines were told ({excerpt.form})."
    )


if __name__ == "__main__":
    main()
