"""An OpenAI-compatible server on 127.0.0.1 that plays a script and records what it was sent."""

import json
import threading
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any


@dataclass(frozen=True)
class Step:
    """One answer of the server."""

    content: str | None = '{"rationale": "", "signals": []}'
    status: int = 200
    message: str = "out of order"
    finish: str = "stop"
    headers: dict[str, str] = field(default_factory=dict)
    raw: str | None = None
    extra: dict[str, Any] = field(default_factory=dict)
    usage: dict[str, Any] | None = field(
        default_factory=lambda: {
            "prompt_tokens": 100,
            "completion_tokens": 20,
            "total_tokens": 120,
            "completion_tokens_details": {"reasoning_tokens": 12},
        }
    )
    hang_up: bool = False


@dataclass(frozen=True)
class Received:
    """One request as it came in."""

    path: str
    headers: dict[str, str]
    body: dict[str, Any]

    @property
    def texts(self) -> list[str]:
        return [m["content"] for m in self.body["messages"]]


class Server:
    """The server; ``script`` may grow while it runs."""

    def __init__(self, script: list[Step]) -> None:
        self.script = script
        self.received: list[Received] = []
        self._lock = threading.Lock()
        outer = self

        class Handler(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_POST(self) -> None:
                length = int(self.headers.get("content-length", 0))
                body = json.loads(self.rfile.read(length) or b"{}")
                if self.path.endswith("/api/show"):  # what Ollama knows of a model, asked in the background
                    self._not_found()
                    return
                headers = {name.lower(): value for name, value in self.headers.items()}
                with outer._lock:
                    outer.received.append(Received(self.path, headers, body))
                    step = outer.script.pop(0) if outer.script else Step(status=410, message="script ended")
                if step.hang_up:
                    self.close_connection = True
                    return
                if step.raw is not None:
                    payload = step.raw.encode()
                elif step.status != 200:
                    payload = json.dumps({"error": {"message": step.message, "code": step.status}}).encode()
                else:
                    payload = json.dumps(_dialect(self.path)(step, body)).encode()
                with suppress(BrokenPipeError, ConnectionResetError):
                    self.send_response(step.status)
                    self.send_header("content-type", "application/json")
                    self.send_header("content-length", str(len(payload)))
                    for name, value in step.headers.items():
                        self.send_header(name, value)
                    self.end_headers()
                    self.wfile.write(payload)

            def do_GET(self) -> None:
                self._not_found()

            def _not_found(self) -> None:
                self.send_response(404)
                self.send_header("content-length", "0")
                self.end_headers()

            def log_message(self, *args: Any) -> None:
                pass

        self._http = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self._http.server_port}/v1"
        self.root = f"http://127.0.0.1:{self._http.server_port}"
        self._thread = threading.Thread(target=self._http.serve_forever, args=(0.02,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._http.shutdown()
        self._http.server_close()


def serving(*script: Step) -> closing[Server]:
    return closing(Server(list(script)))


def openai(step: Step, body: dict[str, Any]) -> dict[str, Any]:
    message = {"role": "assistant", "content": step.content, **step.extra}
    answer = {
        "id": "1",
        "object": "chat.completion",
        "created": 1,
        "model": body.get("model", "m"),
        "choices": [{"index": 0, "message": message, "finish_reason": step.finish}],
    }
    return answer if step.usage is None else {**answer, "usage": step.usage}


def _dialect(path: str) -> Callable[[Step, dict[str, Any]], dict[str, Any]]:
    if "/api/chat" in path:
        return _ollama
    if path.endswith("/messages"):
        return _anthropic
    return _gemini if "generateContent" in path else openai


def _anthropic(step: Step, body: dict[str, Any]) -> dict[str, Any]:
    return {
        "id": "1",
        "type": "message",
        "role": "assistant",
        "model": body["model"],
        "content": [{"type": "text", "text": step.content}],
        "stop_reason": "end_turn" if step.finish == "stop" else step.finish,
        "usage": {"input_tokens": 100, "output_tokens": 20},
    }


def _gemini(step: Step, body: dict[str, Any]) -> dict[str, Any]:
    content = {"role": "model", "parts": [{"text": step.content}]}
    return {
        "candidates": [{"content": content, "finishReason": "STOP", "index": 0}],
        "usageMetadata": {"promptTokenCount": 100, "candidatesTokenCount": 20, "totalTokenCount": 120},
    }


def _ollama(step: Step, body: dict[str, Any]) -> dict[str, Any]:
    return {
        "model": "m",
        "created_at": "2025-01-01T00:00:00Z",
        "message": {"role": "assistant", "content": step.content},
        "done": True,
        "done_reason": step.finish,
        "prompt_eval_count": 100,
        "eval_count": 20,
    }
