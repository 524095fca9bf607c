"""What all processes of a campaign together ask of one language model's server.

litellm takes seconds to import in each process and is tested elsewhere: a small module stands in for it.
"""

import json
from pathlib import Path
from time import monotonic
from typing import cast

import pytest

from falsifier.campaigns import CampaignRequest, Method, cross, run_campaign
from falsifier.problem.source import ProblemSource
from falsifier.search.budget import Budget
from falsifier.search.request import LLMSettings
from tests.llm.server import Step, serving

# Seconds that the server takes for an answer, and those that it asks to wait.
TAKEN, PAUSE = 0.3, 1.5
STAND_IN = """
import json
import sys
from types import ModuleType, SimpleNamespace
from urllib.error import HTTPError
from urllib.request import Request, urlopen


handler = ModuleType("litellm.llms.custom_httpx.http_handler")
handler.HTTPHandler = type("HTTPHandler", (), {})
handler.get_ssl_configuration = lambda *_: True
sys.modules |= {name: handler for name in ("litellm.llms", "litellm.llms.custom_httpx", handler.__name__)}


class UnsupportedParamsError(Exception):
    pass


def get_llm_provider(model):
    return model.split("/")[::-1]


utils = SimpleNamespace(get_optional_params=lambda **_: {})


def completion(model, messages, api_base, **_):
    body = json.dumps({"model": model, "messages": messages}).encode()
    try:
        with urlopen(Request(api_base + "/chat/completions", body)) as answer:
            content = json.load(answer)["choices"][0]["message"]["content"]
    except HTTPError as error:
        error.status_code = error.code
        raise
    choice = SimpleNamespace(message=SimpleNamespace(content=content), finish_reason="stop")
    return SimpleNamespace(choices=[choice], usage=None)
"""
ANSWER = json.dumps({"rationale": "", "signals": [{"name": "u", "values": [0.1, 0.2, 0.3, 0.4]}]})


@pytest.fixture(autouse=True)
def stand_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Worker processes import litellm.py from a folder of this test, as they take over this one's path."""
    (tmp_path / "modules").mkdir()
    (tmp_path / "modules" / "litellm.py").write_text(STAND_IN)
    monkeypatch.syspath_prepend(str(tmp_path / "modules"))


def campaign(server: str, *, runs: int, calls: int) -> CampaignRequest:
    """Runs of one simulation each, which ask once."""
    return CampaignRequest(
        runs=cross(
            [ProblemSource(target="python:tests.problems:impossible")],
            [Method(llm="openai/m", variant="MP4")],
            seeds=range(runs),
            budget=Budget(1),
            asking=LLMSettings(name="", api_base=server, cache=False),
        ),
        calls=calls,
    )


class Limit:
    """A server's script: from the first request on it refuses everything for a while."""

    def __init__(self) -> None:
        self.until = 0.0
        self.refused = 0

    def pop(self, _: int) -> Step:
        """Answer to a request that comes in now."""
        now = monotonic()
        self.until = self.until or now + PAUSE
        if now >= self.until:
            return Step(ANSWER)
        self.refused += 1
        return Step(status=429, headers={"Retry-After": f"{self.until - now + 0.05:.2f}"})


def test_the_limit_holds_over_all_processes(tmp_path: Path) -> None:
    with serving(*[Step(ANSWER, together=2, delay=TAKEN)] * 6) as server:
        outcome = run_campaign(campaign(server.url, runs=6, calls=2), tmp_path / "c", jobs=4)
    assert outcome.progress.counts == {"not falsified": 6}
    assert len(server.received) == 6
    assert server.most_at_once == 2


def test_a_rate_limit_is_met_once_by_each_process_and_then_waited_for(tmp_path: Path) -> None:
    limit = Limit()
    with serving() as server:
        server.script = cast("list[Step]", limit)
        outcome = run_campaign(campaign(server.url, runs=6, calls=4), tmp_path / "c", jobs=4)
    assert outcome.progress.counts == {"not falsified": 6}
    assert 1 <= limit.refused <= 4
    assert len(server.received) == 6 + limit.refused
