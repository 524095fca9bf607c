"""Requests and campaigns that several tests of the command line make."""

import json
from typing import Any

from click.testing import Result

from tests.llm.server import Step

BRAKE_LATE = [100.0, 100.0, 100.0, 0.0, 0.0, 0.0, 0.0]
FULL = [100.0] * 7
ENV = {"OPENAI_API_KEY": "sk-test-not-a-key", "XDG_CACHE_HOME": "cache"}


def reply(
    throttle: list[float], brake: tuple[float, ...] = (0.0, 0.0, 0.0), rationale: str = "because"
) -> Step:
    signals = [{"name": "throttle", "values": throttle}, {"name": "brake", "values": list(brake)}]
    return Step(json.dumps({"rationale": rationale, "signals": signals}))


def at1(server: str, *more: str) -> list[str]:
    return ["run", "AT1", "--llm", "openai/gpt-5-mini", "--variant", "MP4", "--api-base", server, *more]


HARD, NEVER = "python:tests.problems:hard", "python:tests.problems:impossible"


def bench(command: Any, *more: str, code: int | None = None) -> Result:
    asked = ("bench", HARD, NEVER, "--engine", "uniform", "--runs", "2", "--budget", "20", *more)
    result: Result = command(*asked, code=code)
    return result
