"""Tables of the keys of JSON that commands print or write, compared with real output.

A page asks for one by a comment on a line of its own: ``<!-- json run -->``.
"""

import json
import re
from collections.abc import Iterator, Mapping
from contextlib import chdir
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

from click.testing import CliRunner
from mkdocs.exceptions import PluginError

from falsifier.campaigns.analysis import load
from falsifier.campaigns.tables import statistics_json
from falsifier.cli import cli

_MARK = re.compile(r"^<!-- json (\w+) -->$", re.MULTILINE)
_KINDS: Mapping[str, tuple[type, ...]] = {
    "string": (str,),
    "number": (float, int),
    "integer": (int,),
    "object": (dict,),
    "list": (list,),
    "Boolean": (bool,),
}
# What is run to have an output of each kind, in this order; of a list, the first object counts. That of a
# campaign is made of the same run: campaigns start processes.
_COMMANDS = {
    "run": "run AT1 --engine corners --budget 20 --out run --json",
    "simulate": "simulate AT1 --set throttle=100 --out simulated --json",
    "explain": "explain run --json",
    "map": "explain run --map --budget 7 --json",
    "shrink": "explain run --shrink --budget 5 --json",
    "replay": "replay run --json",
    "coverage": "coverage run --json",
    "assess": "assess run --budget 2 --json",
    "margin": "margin python:falsifier.testing:lag_problem --stl x<={limit} --between 0:3 --budget 20 --json",
    "check": "check AT1 --stl speed<=1000 --json",
    "info": "info AT --json",
    "prompt": "llm prompt AT1 --json",
    "": "report run --markdown --arch-comp claims.csv",
    "validate": "tools validate claims.csv --json",
}
_Told = Mapping[str, tuple[str, str]]
# Keys of which several commands have some.
_COMMON: _Told = {
    "requirement": ("string", "its name"),
    "formula": ("string", "the formula; `margin`: with `{limit}`"),
    "about": ("string", "the counterexample's file, or the run whose nearest miss it is"),
    "status": ("string", "how a run ended: `falsified`, `not falsified`, `failed` or `interrupted`"),
    "outcome": (
        "string",
        "of a violation, when it was simulated again: `confirmed`, `fragile` (gone at half the step) or "
        "`refuted`; null: not violated",
    ),
    "reason": (
        "string",
        "why, in words: of the `status`, or else of the `outcome` or of what was `accepted`",
    ),
    "text": ("string", "the result, or what was found, in words"),
    "part": ("string", "part of the formula, or input or parameter, that it is about; empty: all of it"),
    "best": (
        "object",
        "the simulation with the smallest robustness, an [evaluation](#an-evaluation); null: there is none",
    ),
    "smallest_robustness": ("number", "of several simulations; null: none could be judged"),
    "parameterization": ("string", "`fixed` or `free`"),
    "failures": (
        "list",
        "causes of failed simulations: how often (`count`), `reason`, and first `simulation`, from 1",
    ),
    "findings": (
        "list",
        "what could not be shown: `kind`, `text`, `part`, and `margin`, `time` in s and `simulation`, from "
        "1, at which that part came closest to changing its truth; these three may be null",
    ),
    "interrupted": ("Boolean", "whether it was stopped; the rest is of what was simulated by then"),
    "spent": ("object", "what was [spent](#what-was-spent); but for runs and campaigns `simulations` only"),
    "files": ("list", "files that were written"),
}
_CANDIDATE: _Told = {
    "signals": (
        "object",
        "by input: `times` in s, `values` in the input's unit, `interpolation`, and `hold` in s, for which "
        "a value is held; null: not held",
    ),
    "parameters": ("object", "by parameter or initial state: its value, in its unit"),
    "origin": ("string", "name of the engine, or what else proposed it"),
    "rationale": ("string", "why, in words"),
}
_EVALUATION: _Told = {
    **_CANDIDATE,
    "violated": ("Boolean", "whether the requirement is violated; not if it could not be judged"),
    "robustness": (
        "number",
        "in the unit of what decided it; below 0 is a violation; null, like the next four, if it could "
        "not be judged",
    ),
    "critical_time": ("number", "time in s that decided the robustness"),
    "predicate": ("string", "part of the formula that decided it"),
    "values": ("object", "by signal of the formula or input: its value at that time, in its unit"),
    "breach": (
        "object",
        "what broke: `shortfalls` as in the [journal](run-directory.md#lines-of-the-journal), and all of "
        "it as `text`; null: nothing",
    ),
}
_KEYS: Mapping[str, _Told] = {
    "common": _COMMON,
    "evaluation": _EVALUATION,
    "run": {
        "counterexample": (
            "object",
            "the confirmed violation, an [evaluation](#an-evaluation) with `outcome` and `reason`; null: "
            "there is none",
        ),
        "fragile": ("list", "violations that are gone at half the step, in the same form"),
        "refuted": ("list", "violations that were not confirmed for other reasons, in the same form"),
        "not_searched": (
            "list",
            "what was not varied: `name`, `causality`, `value`, the name of its `item`, `reason`",
        ),
        "remarks": ("list", "what to know of how the engine worked, in words"),
        "directory": ("string", "the run directory; null: none was written"),
    },
    "spent": {
        "simulations": ("integer", "simulated candidates, including failed simulations"),
        "failed": ("integer", "those that failed, crashed or timed out"),
        "seconds": ("number", "wall-clock time of the run in s"),
        "simulation_seconds": ("number", "time in the simulator in s"),
        "engine_seconds": ("number", "time in the engine in s, including the language model"),
        "calls": ("integer", "requests to a language model that were answered or timed out"),
        "without_reply": ("integer", "those in vain: too late, interrupted, or not readable"),
        "kept": ("integer", "replies from the cache, without a request"),
        "prompt_tokens": ("integer", "tokens sent"),
        "completion_tokens": ("integer", "tokens received, including reasoning"),
        "reasoning_tokens": ("integer", "tokens of reasoning among these, as far as reported"),
        "cost": ("number", "US dollars; null: unknown"),
    },
    "simulate": {},
    "replay": {},
    "explain": {
        "effects": (
            "list",
            "what came of resetting one part alone: its `name`; its `span` in s, null: all of it; the value "
            "`instead`, and whether it is the rest value (`is_rest`); then `robustness` and `violated`",
        ),
    },
    "shrink": {
        "minimal": ("Boolean", "whether nothing simpler was found nearby; false: the budget ended before"),
        "at_most": ("number", "the largest robustness that was allowed"),
    },
    "map": {
        "persistence": (
            "list",
            "which `share` of the changes still violates, up to a `size`, a share of the range",
        ),
        "rank_correlations": ("object", "by what was changed: its rank correlation with the robustness"),
    },
    "coverage": {
        "requirements": ("list", "names of those that the run searched"),
        "simulations": ("integer", "simulations that this is about, without those that failed"),
        "trajectories": ("integer", "those whose trajectories were kept"),
        "searched": (
            "list",
            "inputs and parameters: `name`, `unit`, `range`, `scale`; the smallest and largest value that "
            "was `tried`; how often each of its `parts` was; `gaps` never tried; simulations by how fast it "
            "`changes`, empty: a parameter",
        ),
        "pairs": (
            "list",
            "of inputs and parameters: their `names`, the number of `combinations`, and of those `tried`",
        ),
        "outputs": ("list", "`name`, `unit`, and the smallest and largest value that was `reached`"),
        "modes": (
            "list",
            "integers, Booleans and enumerations: `name`, values that were `seen`, those `never` seen, "
            "`changes` from one to another",
        ),
        "levels": (
            "list",
            "if there were few values of robustness: `requirement`, the `levels`, and what is `missing` for "
            "a lower one, in words",
        ),
    },
    "assess": {
        "distribution": ("string", "what was drawn, in words"),
        "violations": ("integer", "how many draws violate the requirement"),
        "confidence": ("number", "of the bound and of the interval"),
        "upper_bound": ("number", "one-sided bound on the probability of a violation"),
        "interval": ("list", "two-sided bounds on it"),
        "search": (
            "object",
            "of a run: its number of `simulations`, `smallest_robustness`, the simulation, from 1, with its "
            "first `violation`, whether that can be drawn (`drawable`), and the number of violations that "
            "are `unconfirmed`; null: no run was assessed",
        ),
    },
    "margin": {
        "between": ("list", "smallest and largest threshold"),
        "falsified_at": ("number", "threshold with a violation that is nearest to the next; null: none"),
        "unfalsified_at": ("number", "threshold nearest to that, without a violation; null: none"),
        "searches": ("list", "in order: the `threshold`, and whether it was `falsified`"),
        "complete": ("Boolean", "whether the two are close enough; false: a larger budget narrows it"),
    },
    "check": {
        "kind": ("string", "as `falsifier check` prints it, such as `never`, or `invalid`"),
        "advice": ("string", "what to do"),
    },
    "prompt": {
        "messages": ("list", "what is sent, each with `role` and `content`"),
    },
    "validate": {
        "row": ("integer", "number of the row, from 1"),
        "accepted": ("Boolean", "whether the claim is"),
        "robustness": ("number", "when it was simulated again; null: it was not"),
        "claimed": ("number", "robustness that the file states; null: none"),
    },
    "bench": {
        "label": ("string", "name of the method in tables"),
        "engine": ("string", "its engine; empty: a language model leads"),
        "llm": ("string", "its language model; empty: none"),
        "effort": ("string", "reasoning effort, or empty"),
        "variant": ("string", "prompt variant, or empty"),
        "anonymous": ("Boolean", "whether prompts use neutral names"),
        "profile": ("string", "profile of the spec, or empty"),
        "together": ("Boolean", "whether several requirements shared one search"),
        "runs": ("integer", "finished runs, of which the rest is, except the next, and what says otherwise"),
        "unfinished_runs": ("integer", "runs that failed, have not ended, or have not begun"),
        "falsified_runs": ("integer", "runs with a confirmed counterexample"),
        "rate_interval": ("list", "95 % interval of their share; null: below five runs"),
        "mean": ("number", "mean number of simulations of falsified runs; null: there is none"),
        "mean_interval": ("list", "its 95 % interval; null: below five falsified runs"),
        "median": ("number", "median of the same"),
        "deviation": ("number", "standard deviation of the same; null: below two"),
        "budgets": ("list", "limits on the simulations of any run"),
        "known": ("integer", "runs that began with known inputs"),
        "repeated": ("integer", "runs that repeat the seed of another"),
        "settings": ("integer", "number of different ranges, options and context files"),
    },
    "info": {
        "name": ("string", "the model's name"),
        "description": ("string", "what it says of itself"),
        "fmi_version": ("string", "such as `2.0`"),
        "interfaces": ("list", "`co-simulation`, `model-exchange`"),
        "platforms": ("list", "for which it has binaries"),
        "tool": ("string", "that made it"),
        "start_time": ("number", "in s, of the default experiment, like the next two and the tolerance"),
        "stop_time": ("number", "in s; null, here and below: not stated"),
        "step_size": ("number", "in s"),
        "internal_step": ("number", "of its own solver, in s"),
        "tolerance": ("number", "relative"),
        "variables": (
            "list",
            "all of them: `name`, `description`, `kind` and `type` of values, `causality`, `variability`; "
            "`unit`, `display_unit`, `low`, `high`, `nominal`, `start`; numbers by name of an enumeration "
            "(`literals`); whether it is `settable`, or the `refusal`; `is_state`, `is_clocked`, "
            "`is_relative` (a difference); the name it is an alias of (`alias_of`)",
        ),
        "notes": ("list", "what to know, in words"),
        "components": ("list", "names of a system's FMUs"),
        "connections": ("list", "pairs of an output and an input of a system"),
    },
    "counterexample": {
        "format": ("integer", "1"),
        "requirement": ("string", "its name"),
        "formula": ("string", "the formula"),
        "problem": (
            "object",
            "[how to load it](counterexamples.md), paths relative to this file; null: it was made in Python",
        ),
        "candidate": ("object", "`signals`, `parameters`, `origin` and `rationale`, as in an evaluation"),
        "robustness": ("number", "in the unit of what decided it; below 0"),
        "critical_time": ("number", "time in s that decided it"),
        "predicate": ("string", "part of the formula that decided it"),
        "what_broke": ("string", "what did not hold, and when, in words"),
        "outcome": ("string", "`confirmed`, or `fragile`: not at half the step"),
        "reason": ("string", "why, in words"),
        "fmu_sha256": ("string", "hash of the FMU; null: there is none"),
        "spec_sha256": ("string", "hash of the spec; null: there is none"),
        "allow": ("list", "what the FMU was allowed, paths relative to this file; null: as the spec says"),
        "deny": ("list", "what it was denied"),
        "falsifier": ("string", "version that wrote it"),
        "sum": ("string", "checksum of the file up to the comma before it; without it, nothing is checked"),
    },
}


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Replace the marks of a page by tables."""
    return _MARK.sub(lambda mark: "\n\n".join(_keys(mark[1])), markdown)


@cache
def _written() -> Mapping[str, Any]:
    """One real output of each kind."""
    found: dict[str, Any] = {}
    # Pictures take most of the time.
    undrawn = patch("falsifier.cli.files.draw", lambda _, picture: [picture])
    with TemporaryDirectory() as folder, chdir(folder), undrawn:
        for name, command in _COMMANDS.items():
            said = CliRunner().invoke(cli, command.split()).stdout
            content = json.loads(said) if name else None
            found[name] = content[0] if isinstance(content, list) else content
        (found["bench"],) = json.loads(statistics_json(load(Path("run"))))
        found["counterexample"] = json.loads(Path("run/counterexample.json").read_text(encoding="utf-8"))
    # All that commands have in common, with a value where one of them has one.
    several = [found[name] for name in (*_COMMANDS, "bench") if name]
    known = {key: one[key] for one in several for key in _COMMON if one.get(key)}
    common = {key: known.get(key) for one in several for key in _COMMON if key in one}
    return {**found, "common": common, "evaluation": found["run"]["best"], "spent": found["run"]["spent"]}


def _keys(name: str) -> Iterator[str]:
    """What output has of what several have, in a sentence, and a table of the other keys."""
    told, written = _KEYS[name], _written()[name]
    shared = {key: _COMMON[key] for key in written if key in _COMMON.keys() - told.keys()}
    judged = _EVALUATION if _EVALUATION.keys() <= written.keys() and told is not _EVALUATION else {}
    every = {**shared, **judged, **told}
    if every.keys() != written.keys():
        raise PluginError(
            f"{name}: {sorted(every.keys() ^ written.keys())} are in {__file__} or in JSON only"
        )
    for key, (kind, said) in every.items():
        value = written[key]
        if value is not None and not isinstance(value, _KINDS[kind]):
            raise PluginError(f"{name}: {key} is no {kind}, as {__file__} says: {value!r}")
        below = value[0] if isinstance(value, list) and value else value
        unsaid = [k for k in below if f"`{k}`" not in said] if isinstance(below, dict) else []
        if unsaid and not said.startswith("by ") and "](" not in said:
            raise PluginError(f"{name}: {__file__} does not say what {unsaid} of {key} are")
    if shared:
        names = [f"`{key}`" for key in shared] + (
            ["the keys of an [evaluation](#an-evaluation)"] if judged else []
        )
        yield f"[Common](#common-keys): {', '.join(names)}."
    if told:
        rows = [f"| `{key}` | {kind} | {said} |" for key, (kind, said) in told.items()]
        yield "\n".join(["| key | type | meaning |", "| --- | --- | --- |", *rows])
