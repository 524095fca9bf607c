"""Repeats a question until the reply is valid; a rejected reply is returned to the LLM with its defect."""

from collections.abc import Callable
from typing import TypeVar

from falsifier.core.literals import printable
from falsifier.core.words import counted
from falsifier.errors import ChatError, FalsifierError
from falsifier.llm.failures import ContextExceededError
from falsifier.llm.messages import (
    LONGEST_REPLY,
    UNREADABLE,
    Chat,
    ChatReply,
    ChatRequest,
    Exchange,
    Message,
    ToolCall,
    cleaned,
)

T = TypeVar("T")
OnExchange = Callable[[Exchange], None]
Respond = Callable[[ToolCall], str]

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
        shown = printable(message[: 2 * _LONGEST_PROBLEM])
        super().__init__(shown if len(shown) <= _LONGEST_PROBLEM else f"{shown[:_LONGEST_PROBLEM]} ...")


class NoValidReplyError(ChatError):
    """The LLM answered, but no reply was valid."""


def converse(
    chat: Chat,
    request: ChatRequest,
    read: Callable[[str], T],
    on_exchange: OnExchange,
    *,
    reasks: int = MAX_REASKS,
    respond: Respond | None = None,
) -> T:
    """Ask, answer the LLM's tool calls, and after an invalid reply ask again, stating what was wrong.

    Args:
        chat: chat to ask.
        request: the question.
        read: turns a reply's text into a value, or raises RejectedReplyError.
        on_exchange: called with every question and reply, including rejected ones.
        reasks: how often to ask again after a rejected reply; a reply none of whose tool calls could be
            answered counts as rejected.
        respond: answers a call of a tool that the question offers, or raises RejectedReplyError. It must do
            so after a number of calls, because each call costs another request. None: no tool is offered.

    Raises:
        NoValidReplyError: if no reply was valid.
        ChatError: if there was no reply.
    """
    problems: list[str] = []
    offered = {tool.name for tool in request.tools} if respond is not None else set()
    while len(problems) <= reasks:
        try:
            reply = cleaned(chat.complete(request))
        except ContextExceededError as error:
            # The question itself had room; with the rejected replies it has none.
            if not problems:
                raise
            problems.append(str(error))
            break
        values: list[T] = []
        problem = None
        try:
            # Some servers deliver the answer itself as a call of a tool that nobody offered.
            if respond is not None and any(call.name in offered for call in reply.tool_calls):
                following, problem = _called(request, reply, respond)
            else:
                try:
                    values.append(read(_usable_text(reply)))
                except RejectedReplyError as rejection:
                    problem = str(rejection)
                    if reply.finish_reason == "length":
                        problem = f"{_CUT_OFF} ({problem}); reason less and give a shorter reply"
                following = _asked_again(request, reply, problem or "")
        except Exception as error:
            # A defect, but the reply has been paid for: it is recorded first.
            defect = f"{type(error).__name__}: {error}"
            on_exchange(Exchange(llm=chat.llm, messages=request.messages, reply=reply, problem=defect))
            raise
        on_exchange(Exchange(llm=chat.llm, messages=request.messages, reply=reply, problem=problem))
        if problem is None:
            chat.accepted(request, reply)
            if values:
                return values[0]
        else:
            problems.append(problem)
        request = following
    text = (
        f"{chat.llm} gave no valid reply in {counted(len(problems), 'attempt')}; rejected because: "
        f"{' | '.join(dict.fromkeys(problems))}"
    )
    if problems[-1].startswith(_CUT_OFF):
        text += f"; allow longer replies (--llm-option max_tokens={_MOST_TOKENS}), or less "
        text += "effort (--llm NAME@low)"
    raise NoValidReplyError(text)


def _called(request: ChatRequest, reply: ChatReply, respond: Respond) -> tuple[ChatRequest, str | None]:
    """Answer the calls of a reply; return the next request, and the defect if no call could be answered."""
    answers, problems = [], []
    for call in reply.tool_calls:
        try:
            answers.append(respond(call))
        except RejectedReplyError as rejection:
            problems.append(str(rejection))
            answers.append(f"That call cannot be answered: {rejection}.")
    calls = Message(role="assistant", content=reply.text, tool_calls=reply.tool_calls, echo=reply.echo)
    told = (
        Message(role="tool", content=answer, tool_call_id=call.id)
        for call, answer in zip(reply.tool_calls, answers, strict=True)
    )
    return _followed(request, calls, *told), problems[0] if len(problems) == len(answers) else None


def _usable_text(reply: ChatReply) -> str:
    if reply.finish_reason == "content_filter":
        raise RejectedReplyError("the provider's content filter withheld the reply")
    if reply.finish_reason == UNREADABLE:
        raise RejectedReplyError("the server could not parse it; write nothing before or after the answer")
    if reply.finish_reason == "refusal":
        raise RejectedReplyError(f"the reply refuses the task: {reply.text[:200]}")
    # Some servers put the whole answer into a call of a tool that nobody offered, or into the reasoning.
    reasoning = "" if reply.finish_reason == "length" else reply.reasoning
    places = (reply.text, *(call.arguments for call in reply.tool_calls), reasoning)
    text = next((place for place in places if place.strip()), "")
    if not text:
        raise RejectedReplyError("the reply was empty")
    if len(text) >= LONGEST_REPLY:
        raise RejectedReplyError(f"the reply is too long, {LONGEST_REPLY} characters or more")
    return text


def _asked_again(request: ChatRequest, reply: ChatReply, problem: str) -> ChatRequest:
    quoted = reply.text.strip() or "(empty)"
    if len(quoted) > _LONGEST_QUOTE:
        quoted = f"{quoted[:_LONGEST_QUOTE]} ..."
    again = f"That reply cannot be used: {problem}.\nReply again in the required form."
    following = _followed(
        request, Message(role="assistant", content=quoted), Message(role="user", content=again)
    )
    if reply.finish_reason == "length":
        following = following.model_copy(update={"max_tokens": _more_tokens(reply)})
    return following


def _followed(request: ChatRequest, *messages: Message) -> ChatRequest:
    return request.model_copy(update={"messages": (*request.messages, *messages)})


def _more_tokens(reply: ChatReply) -> int:
    """Twice the limit at which a reply was cut off; without one of the user, twice the length that it had."""
    limit = reply.parameters.get("max_tokens")
    if isinstance(limit, int):
        return 2 * limit
    had = reply.usage.completion_tokens
    return min(max(2 * had, _LEAST_TOKENS), max(had, _MOST_TOKENS))
