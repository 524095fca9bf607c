"""One question until it is answered validly: a rejected reply is returned with what was wrong."""

from collections.abc import Callable
from typing import TypeVar

from falsifier.errors import ChatError, FalsifierError
from falsifier.llm.messages import Chat, ChatReply, ChatRequest, Exchange, Message

T = TypeVar("T")
OnExchange = Callable[[Exchange], None]

MAX_REASKS = 2
# A rejected reply is shown to its author again, but a runaway one not in full.
_LONGEST_QUOTE = 4000


class RejectedReplyError(FalsifierError):
    """A reply cannot be used; the message tells its author why."""


class NoValidReplyError(ChatError):
    """The model answered, but never validly."""


def converse(
    chat: Chat,
    request: ChatRequest,
    read: Callable[[str], T],
    on_exchange: OnExchange,
    *,
    reasks: int = MAX_REASKS,
) -> T:
    """Ask, and ask again with what was wrong.

    Args:
        chat: who is asked.
        request: the question.
        read: makes a value of a reply's text, or raises RejectedReplyError.
        on_exchange: called with every question and answer, rejected ones included.
        reasks: how often a rejected reply is asked for again.

    Raises:
        NoValidReplyError: when no answer was valid.
        ChatError: when no answer came.
    """
    problems: list[str] = []
    for _ in range(reasks + 1):
        reply = chat.complete(request)
        value: T | None = None
        problem = None
        try:
            value = read(_usable_text(reply))
        except RejectedReplyError as rejection:
            problem = _explained(reply, str(rejection))
        on_exchange(
            Exchange(
                model=chat.model,
                messages=request.messages,
                parameters=reply.parameters or dict(chat.parameters),
                reply=reply,
                problem=problem,
            )
        )
        if problem is None and value is not None:
            chat.accepted(request, reply)
            return value
        problems.append(problem or "")
        request = _asked_again(request, reply, problem or "")
    raise NoValidReplyError(
        f"{chat.model} gave no valid reply in {reasks + 1} tries; what was wrong: {' | '.join(problems)}"
    )


def _usable_text(reply: ChatReply) -> str:
    if reply.finish_reason == "content_filter":
        raise RejectedReplyError("the provider's content filter withheld the reply")
    if reply.finish_reason == "refusal":
        raise RejectedReplyError(f"the reply refuses the task: {reply.text[:200]}")
    if not reply.text.strip():
        raise RejectedReplyError("the reply was empty")
    return reply.text


def _explained(reply: ChatReply, problem: str) -> str:
    if reply.finish_reason == "length":
        return f"the reply was cut off at the token limit ({problem}); think less and answer shorter"
    return problem


def _asked_again(request: ChatRequest, reply: ChatReply, problem: str) -> ChatRequest:
    quoted = reply.text.strip() or "(empty)"
    if len(quoted) > _LONGEST_QUOTE:
        quoted = f"{quoted[:_LONGEST_QUOTE]} ..."
    return request.model_copy(
        update={
            "messages": (
                *request.messages,
                Message(role="assistant", content=quoted),
                Message(
                    role="user",
                    content=f"That reply cannot be used: {problem}.\nReply again, in the form asked for.",
                ),
            ),
            "room": 2 if reply.finish_reason == "length" else request.room,
        }
    )
