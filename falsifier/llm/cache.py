"""Valid replies on disk, keyed by the content of the request: no question is paid for twice."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any
from uuid import uuid4

from pydantic import ValidationError

from falsifier.core.files import cache_directory
from falsifier.llm.messages import Chat, ChatReply, ChatRequest, Usage


@dataclass(frozen=True)
class CachedChat:
    """Answers from a directory if possible, and stores there every reply that proved valid.

    Attributes:
        inner: chat to ask if there is no stored reply.
        directory: one file per reply; created with the first one.
    """

    inner: Chat
    directory: Path

    @property
    def llm(self) -> str:
        return self.inner.llm

    @property
    def parameters(self) -> Mapping[str, Any]:
        return self.inner.parameters

    def complete(self, request: ChatRequest) -> ChatReply:
        """Return the stored reply, at no cost, or ask."""
        try:
            stored = ChatReply.model_validate_json(self._path(request).read_bytes())
        except (OSError, ValidationError):  # missing or damaged: ask again and overwrite it
            return self.inner.complete(request)
        return stored.model_copy(update={"usage": Usage(cost=0.0), "seconds": 0.0, "source": "cache"})

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Store a valid reply."""
        if reply.source == "cache":
            return
        path = self._path(request)
        path.parent.mkdir(parents=True, exist_ok=True)
        # Under a unique name first: several runs may store the same reply at the same time.
        partial = path.with_name(f"{path.name}.{uuid4().hex}")
        partial.write_text(reply.model_dump_json(indent=1), encoding="utf-8")
        partial.replace(path)
        self.inner.accepted(request, reply)

    def _path(self, request: ChatRequest) -> Path:
        asked = {
            "llm": self.llm,
            "parameters": dict(self.parameters),
            "request": request.model_dump(mode="json"),
        }
        digest = sha256(json.dumps(asked, sort_keys=True, default=str).encode()).hexdigest()
        return self.directory / digest[:2] / f"{digest}.json"


def default_cache_directory() -> Path:
    """Directory of stored replies: ``replies`` in this tool's cache directory."""
    return cache_directory() / "replies"
