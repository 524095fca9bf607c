"""Repeats a question until the reply is valid; a rejected reply is returned to the LLM with its defect."""

from collections.abc import Callable
from typing import Any, TypeVar

from falsifier.core.literals import printable
from falsifier.core.posix import undisturbed
from falsifier.core.words import counted, shortened, without_full_stop
from falsifier.errors import ChatError, ContextExceededError, FalsifierError, written
from falsifier.llm.messages import (
    LONGEST_REPLY,
    TOOL_CALL,
    UNREADABLE,
    Chat,
    ChatReply,
    ChatRequest,
    Exchange,
    Message,
    cleaned,
)

T = TypeVar("T")
OnExchange = Callable[[Exchange], None]

MAX_REASKS = 2
# Characters of a rejected reply that are quoted back to the LLM; runaway replies are cut.
_LONGEST_QUOTE = 4000
# Characters of a defect that are told; what is wrong stands at the beginning.
_LONGEST_PROBLEM = 1200
_CUT_OFF = "the reply was cut off at the token limit"
# Limits of the tokens of a reply that is asked for again because it was cut off.
_LEAST_TOKENS, _MOST_TOKENS = 4_000, 64_000


class RejectedReplyError(FalsifierError):
    """A reply cannot be used; the message is sent to the LLM."""

    def __init__(self, message: str) -> None:
        told = shortened(printable(message[: 2 * _LONGEST_PROBLEM]).rstrip(), _LONGEST_PROBLEM)
        super().__init__(without_full_stop(told))  # more follows in all messages


class NoValidReplyError(ChatError):
    """The LLM answered, but no reply was valid."""


def converse(
    chat: Chat,
    request: ChatRequest,
    read: Callable[[str], T],
    on_exchange: OnExchange,
    *,
    reasks: int = MAX_REASKS,
) -> T:
    """Ask, and after an invalid reply ask again, stating what was wrong.

    ``read`` turns a reply's text into a value, or raises RejectedReplyError. ``on_exchange`` is called with
    every question and its reply, including rejected ones.

    Raises:
        NoValidReplyError: if no reply was valid.
        ChatError: if there was no reply.
    """
    problems: list[str] = []
    while len(problems) <= reasks:
        try:
            reply = cleaned(chat.complete(request))
        except ContextExceededError as error:
            # The question itself had room; with the rejected replies it has none.
            if not problems:
                raise
            problems.append(str(error))
            break
        with undisturbed():  # it has been paid for
            exchange = Exchange(llm=chat.llm, messages=request.messages, reply=reply)
            try:
                value = read(_usable_text(reply))
            except RejectedReplyError as rejection:
                problem = str(rejection)
                if reply.finish_reason == "length":
                    problem = f"{_CUT_OFF} ({problem}); reason less and give a shorter reply"
                elif reply.finish_reason.startswith(TOOL_CALL):
                    problem = f"it is a {reply.finish_reason} in place of an answer ({problem})"
                on_exchange(exchange.model_copy(update={"problem": problem}))
                problems.append(problem)
                request = _asked_again(request, reply, problem)
            except Exception as error:
                # A defect, but the reply is recorded first.
                on_exchange(exchange.model_copy(update={"problem": f"{type(error).__name__}: {error}"}))
                raise
            else:
                chat.accepted(request, reply)  # first, as the disk of the run may be full
                on_exchange(exchange)
                return value
    raise NoValidReplyError(
        f"{chat.llm} gave no valid reply in {counted(len(problems), 'attempt')}; rejected because: "
        f"{' | '.join(dict.fromkeys(problems))}{_advice(problems[-1])}"
    )


def _advice(problem: str) -> str:
    if not problem.startswith(_CUT_OFF):
        return ""
    longer = written(f"--llm-option max_tokens={_MOST_TOKENS}", f"options={{'max_tokens': {_MOST_TOKENS}}}")
    lower = written("NAME@low", "effort='low'")
    return f"; allow longer replies ({longer}), or less effort ({lower})"


def _usable_text(reply: ChatReply) -> str:
    if reply.finish_reason == "content_filter":
        raise RejectedReplyError("the provider's content filter withheld the reply")
    if reply.finish_reason == UNREADABLE:
        raise RejectedReplyError("the server could not parse it; write nothing before or after the answer")
    if reply.finish_reason == "refusal":
        raise RejectedReplyError(f"the reply refuses the task: {reply.text[:200]}")
    # Some servers put the whole answer into the reasoning.
    is_complete = reply.finish_reason != "length"
    text = reply.reasoning if is_complete and not reply.text.strip() else reply.text
    if not text.strip():
        raise RejectedReplyError("the reply was empty")
    if len(text) >= LONGEST_REPLY:
        raise RejectedReplyError(f"the reply is too long, {LONGEST_REPLY} characters or more")
    return text


def _asked_again(request: ChatRequest, reply: ChatReply, problem: str) -> ChatRequest:
    quoted = shortened(reply.text.strip() or "(empty)", _LONGEST_QUOTE)
    again = f"That reply cannot be used: {problem}.\nReply again in the required form."
    messages = (Message(role="assistant", content=quoted), Message(role="user", content=again))
    changed: dict[str, Any] = {"messages": (*request.messages, *messages)}
    if reply.finish_reason == "length":
        changed["max_tokens"] = _more_tokens(reply)
    return request.model_copy(update=changed)


def _more_tokens(reply: ChatReply) -> int:
    """Twice the limit at which a reply was cut off; without one of the user, twice the length that it had."""
    limit = reply.parameters.get("max_tokens")
    if isinstance(limit, int):
        return 2 * limit
    had = reply.usage.completion_tokens
    return min(max(2 * had, _LEAST_TOKENS), max(had, _MOST_TOKENS))
