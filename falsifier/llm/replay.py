"""Recorded conversations, played again: resumed runs pay for nothing twice, notebooks need no key."""

import json
import threading
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from falsifier.errors import ChatError
from falsifier.llm.messages import Chat, ChatReply, ChatRequest, Exchange


def read_recording(path: Path) -> list[Exchange]:
    """Exchanges of a file with one per line, such as a run's ``journal.jsonl``; other lines are passed over.

    Raises:
        ChatError: when the file cannot be read, or an exchange in it cannot be understood.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
        found = [json.loads(line) for line in lines if line.strip()]
        exchanges = [record.get("exchange", record) for record in found if _is_exchange(record)]
        return [Exchange.model_validate(exchange) for exchange in exchanges]
    except (OSError, ValueError) as error:
        raise ChatError(f"{path}: no recording that can be played: {error}") from None


def _is_exchange(record: Any) -> bool:
    return isinstance(record, dict) and ("exchange" in record or {"messages", "reply"} <= record.keys())


class RecordedChat:
    """Answers with recorded replies in their order, then asks an inner chat.

    Args:
        exchanges: what was recorded, in order.
        inner: who answers after that; None: nobody.
    """

    def __init__(self, exchanges: Iterable[Exchange], inner: Chat | None = None) -> None:
        self._exchanges = list(exchanges)
        self._inner = inner
        self._played = 0
        self._lock = threading.Lock()

    @property
    def llm(self) -> str:
        """Name of the LLM that is asked; without one, that this is a recording, and of what."""
        if self._inner is not None:
            return self._inner.llm
        return f"recording of {self._exchanges[0].llm}" if self._exchanges else "empty recording"

    @property
    def parameters(self) -> Mapping[str, Any]:
        """See Chat."""
        return {} if self._inner is None else self._inner.parameters

    @property
    def remaining(self) -> int:
        """Recorded replies that were not played yet."""
        return len(self._exchanges) - self._played

    def complete(self, request: ChatRequest) -> ChatReply:
        """Return the next recorded reply.

        Raises:
            ChatError: when the recording has ended and nobody is there to ask.
        """
        with self._lock:
            recorded = self._exchanges[self._played] if self.remaining else None
            self._played += recorded is not None
        if recorded is not None:
            if recorded.reply is None:
                raise ChatError(recorded.problem or "no answer came")
            return recorded.reply.model_copy(update={"source": "recording"})
        if self._inner is None:
            raise ChatError(f"the {self.llm} ends after {len(self._exchanges)} replies")
        return self._inner.complete(request)

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """See Chat."""
        if self._inner is not None:
            self._inner.accepted(request, reply)
