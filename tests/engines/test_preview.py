"""What a preview shows is what is sent; test_what_if compares the tool that goes with it."""

from falsifier.engines.llm import make_llm_engine
from falsifier.engines.preview import preview
from falsifier.evaluation.evaluate import evaluate
from falsifier.llm.replay import ScriptedChat
from falsifier.testing import lag_problem


def test_preview_is_what_is_sent() -> None:
    problem = lag_problem()
    for variant in ("MP1", "MP2", "MP5"):
        chat = ScriptedChat(["<point>0 0 0 0</point>", "<point>0 0 0 1</point>"])
        engine = make_llm_engine(problem, chat, variant=variant)
        evaluation = evaluate(problem, *engine.ask())
        engine.tell([evaluation])
        engine.ask()
        assert chat.requests[0].messages == preview(problem, variant=variant)
        assert chat.requests[1].messages == preview(problem, variant=variant, evaluations=[evaluation])
