"""What all processes of a campaign together ask of one language model's server."""

import json
from pathlib import Path

import pytest

from falsifier.budget import Budget
from falsifier.campaign import CampaignRequest, Method, cross, run_campaign
from falsifier.request import ModelRequest, ProblemRequest
from tests.llm.server import Step, serving

# Seconds that the server takes for an answer, and those that it asks to wait.
TAKEN, PAUSE = 0.3, 1.0
ANSWER = json.dumps({"rationale": "", "signals": [{"name": "u", "values": [0.1, 0.2, 0.3, 0.4]}]})


def campaign(server: str, *, runs: int, calls: int) -> CampaignRequest:
    """Runs of one simulation each, which ask once."""
    return CampaignRequest(
        runs=cross(
            [ProblemRequest(target="python:tests.problems:impossible")],
            [Method(model="openai/m", variant="MP4")],
            seeds=range(runs),
            budget=Budget(1),
            asking=ModelRequest(name="", api_base=server, cache=False),
        ),
        calls=calls,
    )


@pytest.mark.parametrize("calls", [2, 4])
def test_the_limit_holds_over_all_processes(tmp_path: Path, calls: int) -> None:
    with serving(*[Step(ANSWER, delay=TAKEN)] * 8) as server:
        outcome = run_campaign(campaign(server.url, runs=8, calls=calls), tmp_path, jobs=4)
    assert outcome.progress.counts == {"not falsified": 8}
    assert len(server.received) == 8
    assert 1 < server.most_at_once <= calls


def test_a_rate_limit_is_met_once_by_each_process_and_then_waited_for(tmp_path: Path) -> None:
    """Two runs at a time: each is told to wait once, and none asks again before its time."""
    limited = Step(status=429, headers={"Retry-After": str(PAUSE)})
    with serving(limited, limited, *[Step(ANSWER)] * 6) as server:
        outcome = run_campaign(campaign(server.url, runs=6, calls=2), tmp_path, jobs=4)
    assert outcome.progress.counts == {"not falsified": 6}
    assert len(server.received) == 8  # six answers and two refusals: nobody asked in vain
