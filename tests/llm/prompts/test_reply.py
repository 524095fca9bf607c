"""What a prompt says of the form of a reply."""

import json
from dataclasses import replace

from falsifier.llm.prompts import VARIANTS, View
from falsifier.llm.prompts.blocks import ReplyBlock
from falsifier.llm.prompts.reply import reply_block
from falsifier.llm.replies import ReplyForm
from falsifier.testing import FREE, START, lag_problem

PROBLEM = lag_problem(free=FREE, parameters=[START])


def built(variant: str, count: int = 1) -> ReplyBlock:
    return reply_block(View.of(PROBLEM), VARIANTS[variant], count)


def test_the_example_has_the_form_that_is_asked_for() -> None:
    assert '"point": [5 numbers]' in built("MP1").example
    assert (
        '"signals": [{"name": "u", "values": [4 numbers]}], "parameters": [{"name": "x0", "value": number}]'
        in built("MP4").example
    )
    assert built("MP4", count=2).example.startswith('{"candidates": [{"rationale"')
    free = json.loads(built("MP5", count=3).example)
    (one,) = free["candidates"]
    assert one["signals"] == [
        {"name": "u", "interpolation": "constant", "times": [0.0, 2.4, 6.2], "values": [-0.74, 0.72, -0.16]}
    ]
    ReplyForm(PROBLEM.space, free=True).read(json.dumps(one))
    assert built("MP5").notes
    fixed = View.of(replace(PROBLEM, space=PROBLEM.space.fixed))
    (note,) = reply_block(fixed, VARIANTS["MP5"], 1).notes
    assert "Every input and parameter" in note
    assert reply_block(View.of(lag_problem()), VARIANTS["MP5"], 1).notes == ()


def test_points_are_asked_for_in_the_order_of_the_list_or_a_stated_one() -> None:
    view = View.of(replace(PROBLEM, space=PROBLEM.space.fixed))
    published, own = (reply_block(view, VARIANTS[name], 1, "points") for name in ("MP2", "MP5"))
    assert (published.example, published.order) == ("", "its 5 numbers in the order above")
    assert own.order == "its 5 numbers in this order: the values of u at its 4 control points, x0"
