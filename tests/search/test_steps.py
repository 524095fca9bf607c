from falsifier.engines.simple import Uniform
from falsifier.llm.replay import ScriptedChat
from falsifier.search.steps import Live
from falsifier.testing import lag_problem


def test_every_step_is_carried_out() -> None:
    problem, steps = lag_problem(), Live()
    candidates, wanted, seconds = steps.ask(problem, Uniform(problem, seed=1), 3)
    assert (len(candidates), wanted) == (3, 3) and seconds > 0
    evaluations = [wait() for wait in steps.start(problem, candidates)]
    assert [e.candidate for e in evaluations] == candidates
    assert steps.tell(Uniform(problem, seed=1), evaluations) > 0
    worst = min(evaluations, key=lambda e: e.robustness or 0.0)
    assert steps.confirm(problem, worst, 0).robustness == worst.robustness
    chat = ScriptedChat([])
    assert steps.chat(chat) is chat
    assert (steps.replayed, steps.seconds) == (0, 0.0)
