"""One question until it is answered validly: a rejected reply is returned with what was wrong."""

from collections.abc import Callable
from typing import TypeVar

from falsifier.errors import ChatError, FalsifierError
from falsifier.llm.messages import Chat, ChatReply, ChatRequest, Exchange, Message, ToolCall

T = TypeVar("T")
OnExchange = Callable[[Exchange], None]
Respond = Callable[[ToolCall], str]

MAX_REASKS = 2
# A rejected reply is shown to its author again, but a runaway one not in full.
_LONGEST_QUOTE = 4000


class RejectedReplyError(FalsifierError):
    """A reply cannot be used; the message tells its author why."""


class NoValidReplyError(ChatError):
    """The LLM answered, but never validly."""


def converse(
    chat: Chat,
    request: ChatRequest,
    read: Callable[[str], T],
    on_exchange: OnExchange,
    *,
    reasks: int = MAX_REASKS,
    respond: Respond | None = None,
) -> T:
    """Ask, answer what the LLM asks in its turn, and ask again with what was wrong.

    Args:
        chat: who is asked.
        request: the question.
        read: makes a value of a reply's text, or raises RejectedReplyError.
        on_exchange: called with every question and answer, rejected ones included.
        reasks: how often a rejected reply is asked for again; one in which no call of a tool could be
            answered counts as rejected.
        respond: answers a call of a tool that the question offers, or raises RejectedReplyError, as it must
            after some calls, for each is a request more; None: no tool is offered.

    Raises:
        NoValidReplyError: when no answer was valid.
        ChatError: when no answer came.
    """
    problems: list[str] = []
    while len(problems) <= reasks:
        reply = chat.complete(request)
        values: list[T] = []
        problem = None
        if respond is not None and reply.tool_calls:
            following, problem = _called(request, reply, respond)
        else:
            try:
                values.append(read(_usable_text(reply)))
            except RejectedReplyError as rejection:
                problem = _explained(reply, str(rejection))
            following = _asked_again(request, reply, problem or "")
        on_exchange(
            Exchange(
                llm=chat.llm,
                messages=request.messages,
                parameters=reply.parameters or dict(chat.parameters),
                reply=reply,
                problem=problem,
            )
        )
        if problem is None:
            chat.accepted(request, reply)
            if values:
                return values[0]
        else:
            problems.append(problem)
        request = following
    raise NoValidReplyError(
        f"{chat.llm} gave no valid reply in {reasks + 1} tries; what was wrong: {' | '.join(problems)}"
    )


def _called(request: ChatRequest, reply: ChatReply, respond: Respond) -> tuple[ChatRequest, str | None]:
    """Answer the calls of a reply: what is sent next, and what was wrong if no call could be answered."""
    answers, problems = [], []
    for call in reply.tool_calls:
        try:
            answers.append(respond(call))
        except RejectedReplyError as rejection:
            problems.append(str(rejection))
            answers.append(f"That call cannot be answered: {rejection}.")
    following = request.model_copy(
        update={
            "messages": (
                *request.messages,
                Message(role="assistant", content=reply.text, tool_calls=reply.tool_calls, echo=reply.echo),
                *(
                    Message(role="tool", content=answer, tool_call_id=call.id)
                    for call, answer in zip(reply.tool_calls, answers, strict=True)
                ),
            )
        }
    )
    return following, problems[0] if len(problems) == len(answers) else None


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
