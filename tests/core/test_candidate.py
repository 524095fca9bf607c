import json

from falsifier.core.candidate import Candidate
from falsifier.core.signals import Signal

HELD = Signal((0.0, 1.0), (2.0, 3.0), "constant", hold=0.5)
FREE = Signal((0.0,), (1.0,), "linear")


def test_what_is_simulated_is_the_key_whoever_proposed_it() -> None:
    one = Candidate({"a": HELD, "b": FREE}, {"p": 1.0, "q": 2.0}, "uniform", "random")
    other = Candidate({"b": FREE, "a": HELD}, {"q": 2.0, "p": 1.0}, "somebody")
    assert one.key == other.key
    assert len({one.key, other.key}) == 1, "keys can be looked up"
    assert one.key != Candidate({"a": HELD, "b": FREE}, {"p": 1.0, "q": 2.5}).key
    assert one.key != Candidate({"a": FREE, "b": FREE}, {"p": 1.0, "q": 2.0}).key


def test_it_goes_through_json_whole() -> None:
    candidate = Candidate({"a": HELD, "b": FREE}, {"p": 0.1 + 0.2}, "llm MP5", "because of x < 1")
    assert Candidate.from_json(json.loads(json.dumps(candidate.to_json()))) == candidate
