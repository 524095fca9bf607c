"""Valid replies on disk, by the content of what was asked: no question is paid for twice."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any
from uuid import uuid4

from pydantic import ValidationError

from falsifier.llm.messages import Chat, ChatReply, ChatRequest, Usage


@dataclass(frozen=True)
class CachedChat:
    """Answers from a directory where it can, and keeps there what proved valid.

    Attributes:
        inner: who is asked otherwise.
        directory: one file per reply, made when the first one is kept.
    """

    inner: Chat
    directory: Path

    @property
    def llm(self) -> str:
        """See Chat."""
        return self.inner.llm

    @property
    def parameters(self) -> Mapping[str, Any]:
        """See Chat."""
        return self.inner.parameters

    def complete(self, request: ChatRequest) -> ChatReply:
        """Return the kept reply, at no cost, or ask."""
        try:
            kept = ChatReply.model_validate_json(self._path(request).read_bytes())
        except (OSError, ValidationError):  # not there, or damaged: then it is asked for and written anew
            return self.inner.complete(request)
        return kept.model_copy(update={"usage": Usage(cost=0.0), "seconds": 0.0, "source": "cache"})

    def accepted(self, request: ChatRequest, reply: ChatReply) -> None:
        """Keep a valid reply."""
        if reply.source == "cache":
            return
        path = self._path(request)
        path.parent.mkdir(parents=True, exist_ok=True)
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
    """Where replies are kept unless said otherwise."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "falsifier" / "replies"
