"""What a run asked a language model, why it proposed what it did, and what came of it, as HTML.

Prompts are folded; nothing needs a script.
"""

from itertools import takewhile
from pathlib import Path

from falsifier.core.literals import shell_word
from falsifier.core.words import counted, in_one_line, readable
from falsifier.llm.messages import Exchange, Message
from falsifier.record.journal import read_journal
from falsifier.record.questions import Iteration, iterations
from falsifier.views.html import Html, el, join

_WRAPPED = "white-space: pre-wrap; overflow-wrap: anywhere"


def exchanges_html(directory: Path, requirement: str, *, most: int) -> Html:
    """Show the latest turns in which a requirement's engine asked, and how the others are shown.

    Empty if the recorded run asked nothing.
    """
    asked = [one for one in iterations(read_journal(directory), requirement) if one.exchanges]
    parts, before = [], tuple[Message, ...]()
    for one in asked[-most:]:
        parts.append(_iteration(one, before))
        before = one.exchanges[-1].messages
    if len(asked) > len(parts):
        said = "Earlier questions are not shown; the last one before sample N: "
        command = el("code", f"falsifier llm prompt {shell_word(directory)} --at N")
        parts.insert(0, el("p", said, command, class_="note"))
    return join(*parts)


def _iteration(one: Iteration, before: tuple[Message, ...]) -> Html:
    first = f"before sample {one.samples[0].index + 1}" if one.samples else "at the end"
    asked = counted(len(one.exchanges), "question")
    tokens = sum(exchange.usage.tokens for exchange in one.exchanges)
    seconds = sum(exchange.seconds for exchange in one.exchanges)
    came = "; ".join(o.text or "not simulated" for o in one.samples) or "no candidate"
    heading = f"{asked} {first}, {tokens} tokens, {readable(seconds, 3)} s: {came}"
    shown = []
    for exchange in one.exchanges:
        shown.append(exchange_html(exchange, before))
        before = exchange.messages
    proposals = []
    for sample in one.samples:
        candidate, number = sample.candidate, el("b", f"Sample {sample.index + 1}: ")
        why = el("blockquote", candidate.rationale) if candidate.rationale else ""
        what = f"{candidate.origin}: {in_one_line(candidate)}. "
        proposals.append(el("li", number, what, el("b", sample.text or "not simulated"), why))
    return el("details", el("summary", heading), el("ul", *proposals), *shown, class_="exchange")


def exchange_html(exchange: Exchange, before: tuple[Message, ...] = ()) -> Html:
    """One question and its reply; messages that the question before had are not repeated."""
    pairs = zip(before, exchange.messages, strict=False)
    known = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
    usage, reply = exchange.usage, exchange.reply
    prompt = [el("summary", f"Prompt: {counted(usage.prompt_tokens, 'token')}")]
    if known:
        prompt.append(el("p", f"{counted(known, 'message')} as in the question before", class_="note"))
    prompt += [join(el("p", el("b", m.role)), _text(m.content)) for m in exchange.messages[known:]]
    parts = [
        el("details", *prompt, class_="prompt"),
        el("p", f"Reply of {exchange.llm}: {counted(usage.completion_tokens, 'token')}"),
        _text(reply.text.strip() if reply else "(none)"),
    ]
    if exchange.problem:
        parts.append(el("p", el("b", "Rejected: " if reply else "Failed: "), exchange.problem))
    return join(*parts)


def _text(text: str) -> Html:
    return el("pre", text, style=_WRAPPED)
