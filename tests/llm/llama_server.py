"""llama.cpp's own OpenAI-compatible server on 127.0.0.1, in a process of its own, with a tiny model."""

import importlib.util
import os
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
    command = [sys.executable, "-m", "tests.llm.llama_server", str(model), str(context)]
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


def _serve(model: str, context: int) -> None:
    """Serve until the standard input is closed, which is also when the tests die."""
    import xllamacpp

    settings = xllamacpp.CommonParams()
    settings.model.path = model
    settings.n_ctx = context
    settings.port = 0
    settings.n_gpu_layers = 0
    settings.cpuparams.n_threads = settings.cpuparams_batch.n_threads = 1
    settings.warmup = settings.fit_params = False
    settings.sampling.seed = 1
    server = xllamacpp.Server(settings)
    print(f"{LISTENING}{server.listening_address}", flush=True)
    sys.stdin.read()
    os._exit(0)  # the server's own end waits for replies that are being written


if __name__ == "__main__":
    _serve(sys.argv[1], int(sys.argv[2]))
