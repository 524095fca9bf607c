"""Tables of the keys of JSON that commands print or write, compared with real output.

A page asks for one by a comment on a line of its own: ``<!-- json result -->``.
"""

import json
import re
from collections.abc import Mapping
from functools import cache
from typing import Any

from mkdocs.exceptions import PluginError

from falsifier.counterexamples.store import to_store
from falsifier.record.run import falsify
from falsifier.testing import lag_problem
from falsifier.views.text import result_json

_MARK = re.compile(r"^<!-- json (\w+) -->$", re.MULTILINE)
_KINDS: Mapping[str, tuple[type, ...]] = {
    "string": (str,),
    "number": (float, int),
    "integer": (int,),
    "object": (dict,),
    "list": (list,),
    "Boolean": (bool,),
}
_CANDIDATE = {
    "signals": (
        "object",
        "by input: `times` in s, `values` in the input's unit, `interpolation`, and `hold` in s, for which "
        "a value is held; null: not held",
    ),
    "parameters": ("object", "value by parameter or initial state, in its unit"),
    "origin": ("string", "name of the engine, or what else proposed it"),
    "rationale": ("string", "why, in words"),
}
_KEYS: Mapping[str, Mapping[str, tuple[str, str]]] = {
    "result": {
        "requirement": ("string", "its name"),
        "formula": ("string", "the formula"),
        "status": ("string", "`falsified`, `not falsified`, `failed` or `interrupted`"),
        "reason": ("string", "why it ended, in words"),
        "counterexample": (
            "object",
            "the confirmed violation, an [evaluation](#an-evaluation); null: there is none",
        ),
        "best": ("object", "the evaluation with the smallest robustness; null: none could be judged"),
        "parameterization": ("string", "`fixed` or `free`"),
        "findings": (
            "list",
            "what the search could not show: `kind`, `text`, `part`, and `margin`, `time` in s and "
            "`simulation`, which may be null",
        ),
        "failures": ("list", "causes of failed simulations, with how often each occurred"),
        "not_searched": (
            "list",
            "what was not varied: `name`, `causality`, `value`, the name of its `item`, `reason`",
        ),
        "fragile": ("list", "violations that are gone at half the step: evaluations with the `reason`"),
        "remarks": ("list", "what to know of how the engine worked, in words"),
        "not_confirmed": ("list", "why other violations were not confirmed, in words"),
        "spent": ("object", "what was [spent](#what-was-spent)"),
        "directory": ("string", "the run directory; null: none was written"),
    },
    "evaluation": {
        **_CANDIDATE,
        "robustness": (
            "number",
            "in the unit of what decided it; below 0 is a violation; null, like the next four, if it could "
            "not be judged",
        ),
        "critical_time": ("number", "time in s that decided the robustness"),
        "predicate": ("string", "part of the formula that decided it"),
        "values": ("object", "values of its signals and of the inputs at that time, in their units"),
        "breach": (
            "object",
            "what broke: `shortfalls` as in the [journal](run-directory.md#lines-of-the-journal), and all of "
            "it as `text`; null: nothing",
        ),
    },
    "spent": {
        "simulations": ("integer", "simulated candidates, including failed simulations"),
        "failures": ("integer", "those that failed, crashed or timed out"),
        "seconds": ("number", "wall-clock time of the run in s"),
        "simulation_seconds": ("number", "time in the simulator in s"),
        "engine_seconds": ("number", "time in the engine in s, including the language model"),
        "calls": ("integer", "requests to a language model that were answered or timed out"),
        "without_reply": ("integer", "those that timed out, or whose answer cannot be read"),
        "kept": ("integer", "replies from the cache, without a request"),
        "prompt_tokens": ("integer", "tokens sent"),
        "completion_tokens": ("integer", "tokens received, including reasoning"),
        "reasoning_tokens": ("integer", "tokens of reasoning among these, as far as reported"),
        "cost": ("number", "US dollars; null: unknown"),
    },
    "counterexample": {
        "format": ("integer", "1"),
        "requirement": ("string", "its name"),
        "formula": ("string", "the formula"),
        "problem": (
            "object",
            "how to load it, paths relative to this file; null: it was made in Python",
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
    return _MARK.sub(lambda mark: _keys(mark[1]), markdown)


@cache
def _written() -> Mapping[str, Any]:
    """One real output of each kind."""
    result = falsify(lag_problem(), "corners", budget=10)
    assert result.counterexample is not None
    shown = json.loads(json.dumps(result_json(result)))
    stored = json.loads(to_store(result.counterexample).model_dump_json())
    return {
        "result": shown,
        "evaluation": shown["counterexample"],
        "spent": shown["spent"],
        "counterexample": stored,
    }


def _keys(name: str) -> str:
    told, written = _KEYS[name], _written()[name]
    if told.keys() != written.keys():
        raise PluginError(f"{name}: {sorted(told.keys() ^ written.keys())} are in {__file__} or in JSON only")
    for key, (kind, _) in told.items():
        value = written[key]
        if value is not None and not isinstance(value, _KINDS[kind]):
            raise PluginError(f"{name}: {key} is no {kind}, as {__file__} says: {value!r}")
    rows = [f"| `{key}` | {kind} | {said} |" for key, (kind, said) in told.items()]
    return "\n".join(["| key | type | meaning |", "| --- | --- | --- |", *rows])
