from falsifier.campaigns import Method, Progress, RunProgress
from falsifier.search.budget import Spent
from falsifier.search.request import RunRequest
from falsifier.views.campaign_progress import Scoreboard, overall_line


def run(name: str, seed: int, status: str, simulations: int = 0, best: float | None = None) -> RunProgress:
    spent = Spent(simulations=simulations, calls=1, prompt_tokens=90, completion_tokens=10, cost=0.25)
    return RunProgress(
        name=f"{name}-{seed}",
        requirement=name,
        method=Method("uniform"),
        seed=seed,
        request=RunRequest(problems=()),
        status=status,  # type: ignore[arg-type]
        best=None if best is None else 0,
        counterexample=0 if status == "falsified" else None,
        _robustness=[] if best is None else [best],
        spent=spent,
    )


BEFORE = Progress((run("A", 0, "running", 3, 0.5), run("A", 1, "waiting"), run("B", 0, "waiting")))
AFTER = Progress(
    (run("A", 0, "falsified", 7, -0.5), run("A", 1, "running", 2, 0.1), run("B", 0, "failed", 1))
)


def test_plain_lines_say_each_end_once() -> None:
    lines: list[str] = []
    board = Scoreboard(lines.append)
    for progress in (BEFORE, AFTER, AFTER):
        board(progress)
    assert lines == [
        "3 runs, 0 already finished",
        overall_line(BEFORE),
        "[1/3] A uniform seed 0: falsified after 7 simulations, best robustness -0.5",
        "[2/3] B uniform seed 0: failed after 1 simulation: ",
    ]


def test_runs_that_are_repeated_say_how_they_end_though_as_before() -> None:
    lines: list[str] = []
    board = Scoreboard(lines.append)
    before = (run("A", 0, "falsified", 7, -0.5), run("A", 1, "failed", 1), run("B", 0, "interrupted", 1))
    after = (before[0], run("A", 1, "failed", 2), run("B", 0, "falsified", 3, -0.1))
    for runs in (before, before, after, after):
        board(Progress(runs))
    assert lines[2:] == [
        "[2/3] A uniform seed 1: failed after 2 simulations: ",
        "[3/3] B uniform seed 0: falsified after 3 simulations, best robustness -0.1",
    ]


def test_the_overall_line_counts_everything() -> None:
    assert overall_line(AFTER) == (
        "1/3 runs finished, 1 falsified, 1 failed, 1 running, 10 simulations, 300 tokens, 0.7500 US dollars"
    )


def test_on_a_terminal_the_overall_line_is_replaced_and_ends_stay() -> None:
    kept: list[str] = []
    live: list[str] = []
    board = Scoreboard(kept.append, live.append)
    for progress in (BEFORE, AFTER):
        board(progress)
    assert len(kept) == 3 and [line.partition(",")[0] for line in live] == [
        "0/3 runs finished",
        "1/3 runs finished",
    ]
