"""llama.cpp's own OpenAI-compatible server on 127.0.0.1, in a process of its own, with a tiny model."""

import importlib.util
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LISTENING = "listening at "


def needs_llama_server() -> None:
    """Skip if llama.cpp's server is not installed."""
    if importlib.util.find_spec("xllamacpp") is None:
        pytest.skip("llama.cpp's server is not installed: pip install 'falsifier[llama]'")


@contextmanager
def llama_server(model: Path, *, context: int) -> Iterator[str]:
    """Serve a model; yield the address for ``--api-base``.

    Args:
        model: a GGUF file.
        context: maximum number of tokens of prompt and reply together.
    """
    command = [sys.executable, "-m", "falsifier.llm.model_file", str(model), str(context)]
    with (
        model.with_suffix(f".{context}.log").open("w+") as log,
        subprocess.Popen(
            command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=log, text=True
        ) as process,
    ):
        assert process.stdout is not None
        try:
            told = next((line for line in process.stdout if line.startswith(LISTENING)), "")
            log.seek(0)
            assert told, f"llama.cpp's server does not start: {log.read()}"
            yield f"{told.removeprefix(LISTENING).strip()}/v1"
        finally:
            process.kill()
