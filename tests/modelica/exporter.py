"""The exporter in its own environment, as a process that has read Modelica before.

The parser derives its tables from the grammar while it reads; each further export of the process has them.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from importlib import import_module
from io import StringIO
from pathlib import Path

ROOT = Path(__file__).parents[2]


class Exporter:
    """The process that exports, one model at a time. It ends with this process.

    Args:
        python: the Python of the exporter's environment.
    """

    def __init__(self, python: str) -> None:
        command = [python, __file__, str(ROOT / "modelica")]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run the exporter's command line."""
        assert self._process.stdin is not None and self._process.stdout is not None
        print(json.dumps(arguments), file=self._process.stdin, flush=True)
        return subprocess.CompletedProcess(arguments, *json.loads(self._process.stdout.readline()))


@cache
def exporter(python: str) -> Exporter:
    """The one of this process, started when it is first needed."""
    return Exporter(python)


def serve() -> None:
    """Answer each line of arguments with the exit code and both outputs."""
    main = import_module("export.cli").main
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # compilers that it starts may print
    for line in sys.stdin:
        with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
            code = main(json.loads(line))
        print(json.dumps([code, out.getvalue(), err.getvalue()]), file=answers, flush=True)


if __name__ == "__main__":
    sys.path.insert(0, sys.argv[1])
    serve()
