"""What signals were each time that a discrete one changed, against columns made for it."""

import re
from dataclasses import replace

import numpy as np

from falsifier.core.model import ModelInfo, Variable
from falsifier.core.trajectory import Trajectory
from falsifier.llm.prompts import View
from falsifier.llm.prompts.courses import Array
from falsifier.llm.prompts.regularities import Regularities
from falsifier.testing import lag_problem

TIMES = np.linspace(0.0, 100.0, 1001)
# It rises from 1 to 2 in 11.5 s, again and again; the input is switched every 9.4 s.
SAW, SWITCHED = 1.0 + np.mod(TIMES, 11.5) / 11.5, np.sign(np.sin(TIMES / 3.0))


def lines(count: int, counter: Array, mode: Array) -> list[str]:
    """What is told of so many samples with these discrete signals beside the ones above."""
    view = View.of(lag_problem("G (x <= 0.9)"))
    kinds = (Variable("x"), Variable("n", kind="integer"), Variable("mode", kind="boolean"))
    experiment = replace(view.experiment, stop_time=100.0, output_interval=0.1, outputs=("x", "n", "mode"))
    space = replace(view.space, stop_time=100.0)
    seen = Regularities(
        replace(view, info=ModelInfo("m", variables=kinds), space=space, experiment=experiment)
    )
    for k in range(count):  # those with the same beginning would be one
        seen.add(Trajectory(TIMES, {"x": SAW + 1e-9 * k, "n": counter, "mode": mode, "u": SWITCHED}))
    return seen.text.splitlines()


def test_thresholds_and_conditions_are_told_of_changes_that_were_seen_several_times() -> None:
    parity, follower = np.floor(TIMES / 11.5) % 2, (SWITCHED > 0).astype(np.float64)
    assert lines(1, TIMES // 50, 0 * TIMES)[1:] == ["- x jumps down, 8 times: x 1.991"]
    head, up, down, on, off, jump = lines(3, parity, follower)
    assert "just before each change" in head and jump.startswith("- x jumps down, 24 times: x 1.991")
    assert [up, down] == [
        f"- n {way}, 12 times: x 1.991, n unchanged for 11.5 s" for way in ("0 -> 1", "1 -> 0")
    ]
    assert on.startswith("- mode 0 -> 1, ") and off.startswith("- mode 1 -> 0, ")
    assert "u just changed, u 1" in on and "u just changed, u -1" in off, "an input has its new value"


def test_two_thresholds_are_told_as_two() -> None:
    outside = (np.abs(SAW - 1.5) > 0.3).astype(np.float64)
    off, on = lines(2, 0 * TIMES, outside)[1:3]
    assert re.fullmatch(r"- mode 1 -> 0, \d+ times: x 1\.19\d*( to 1\.2)?, mode .*", off)
    assert re.fullmatch(r"- mode 0 -> 1, \d+ times: x 1\.79\d*( to 1\.8)?, mode .*", on)
    turned = (np.abs(SAW - 1.5) > 0.3) ^ (np.abs(SAW - 1.5) > 0.1)
    (on, off) = lines(2, 0 * TIMES, turned.astype(np.float64))[1:3]
    assert " or " in on and " or " in off


def test_all_steps_of_a_counter_are_one_change() -> None:
    _, only, _ = lines(2, np.floor(TIMES / 11.5), 0 * TIMES)
    assert only.startswith("- n up, 16 times: x 1.991")
    chatter = np.mod(TIMES * 10 // 1, 2.0)
    (_, only) = lines(2, chatter, chatter)
    assert only.startswith("- x jumps down"), "nothing is told of what chatters"


def test_how_long_an_input_had_its_value_and_which_where_it_changes_at_the_same_time() -> None:
    view = View.of(lag_problem("G (x <= 0.9)"))
    seen = Regularities(replace(view, info=ModelInfo("m", variables=(Variable("x", kind="integer"),))))
    times = np.linspace(0.0, 10.0, 101)
    for start in (2.0, 3.0, 5.5, 6.5):  # the input is 0.25 for one second, and then changes more often
        held, acts = (times > start - 1.05) & (times < start - 0.05), times > start - 0.05
        u = np.where(held, 0.25, np.where(acts, np.floor(times * start) / 40, start / 9))
        seen.add(Trajectory(times, {"x": acts.astype(np.float64), "u": u}))
    assert seen.text.endswith("- x 0 -> 1, 4 times: u 0.25 until then, u unchanged for 1 s")


def test_when_a_signal_that_rested_starts_and_what_was_compared_then() -> None:
    seen, times = Regularities(View.of(lag_problem("G (x - u <= 0.9)"))), np.linspace(0.0, 10.0, 101)
    for rest, start in enumerate((2.05, 3.05, 5.05)):
        columns = {"x": rest + np.maximum(times - start, 0.0), "u": rest + times - start - 4}
        seen.add(Trajectory(times, columns))
    assert "- x starts to move up, 3 times: x - u 4.05" in seen.text


def test_what_was_so_in_samples_with_the_same_beginning_was_so_once() -> None:
    view = replace(
        View.of(lag_problem("G (x <= 0.9)")), info=ModelInfo("m", variables=(Variable("x", kind="integer"),))
    )
    seen = Regularities(view)
    times = np.linspace(0.0, 10.0, 101)
    for _ in range(3):
        seen.add(Trajectory(times, {"x": np.where(times > 5, 1.0, 0.0), "u": times}))
    assert seen.text == ""
    seen.add(Trajectory(times, {"x": np.where(times > 7, 1.0, 0.0), "u": times - 2}))
    assert seen.text.endswith("- x 0 -> 1, 2 times: u 5.1")


def test_a_real_signal_that_is_discrete_in_some_samples_only_jumps_in_all() -> None:
    seen = Regularities(View.of(lag_problem("G (x <= 0.9)")))
    times = np.linspace(0.0, 10.0, 101)
    for end in (1.0, 1.0, 1.5, 1.5):
        start = 4.0 + len(seen._known)
        seen.add(Trajectory(times, {"x": np.where(times > start, end, 0.0), "u": times - start}))
    assert "signals just before each change" in seen.text
    assert [*seen.text.splitlines()[1:]] == ["- x jumps up, 4 times: u 0.1"]


def test_an_input_at_the_start_was_not_just_switched_and_little_of_a_sample_is_kept() -> None:
    view = View.of(lag_problem("G (x <= 0.9)"))
    seen = Regularities(replace(view, info=ModelInfo("m", variables=(Variable("x", kind="integer"),))))
    times = np.linspace(0.0, 10.0, 1001)
    for k in range(4):
        u = np.where(times > k + 1, 1.0, k / 4)
        seen.add(Trajectory(times, {"x": np.where(times > 0, 1.0, 0.0), "u": u}))
    assert seen.text == ""
    assert all(kept.base is None for kept in seen._known), "a part that refers to the whole keeps that"


def test_durations_are_not_told_where_nothing_else_was_switched() -> None:
    seen, times = Regularities(View.of(lag_problem("G (x <= 0.9)"))), np.linspace(0.0, 10.0, 101)
    for k in range(3):
        seen.add(Trajectory(times, {"x": np.maximum(times - 2, 0.0), "u": times * (k - 1)}))
    assert seen.text == ""
