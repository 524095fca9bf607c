"""The exporter in its own environment, as a process that has read Modelica before and forks for each export.

The parser derives its tables from the grammar while it reads. Copies of a process that has read the feature
models have these tables.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from tempfile import NamedTemporaryFile
from typing import NoReturn

ROOT = Path(__file__).parents[2]
FEATURES = Path(__file__).parent / "Features"


class Exporter:
    """The process that forks; one export at a time. It ends with this process.

    Args:
        python: the Python of the exporter's environment.
    """

    def __init__(self, python: str) -> None:
        command = [python, __file__, str(ROOT / "modelica"), str(FEATURES)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def run(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """Run the exporter's command line."""
        assert self._process.stdin is not None and self._process.stdout is not None
        with NamedTemporaryFile("r") as out, NamedTemporaryFile("r") as err:
            request = [arguments, [out.name, err.name], str(Path.cwd())]
            self._process.stdin.write(f"{json.dumps(request)}\n")
            self._process.stdin.flush()
            code = int(self._process.stdout.readline())
            return subprocess.CompletedProcess(arguments, code, out.read(), err.read())


@cache
def exporter(python: str) -> Exporter:
    """The one of this process, started when it is first needed."""
    return Exporter(python)


def serve(features: Path) -> None:
    """Fork for each request; the copies export and end."""
    import_module("export.read.library").load(features)
    for line in sys.stdin:
        pid = os.fork()
        if not pid:
            _export(*json.loads(line))
        _, status = os.waitpid(pid, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


def _export(arguments: list[str], streams: list[str], folder: str) -> NoReturn:
    code = 1
    try:
        os.chdir(folder)
        for number, stream in enumerate(streams, 1):
            os.dup2(os.open(stream, os.O_WRONLY), number)
        code = import_module("export.cli").main(arguments)
    except SystemExit as ending:
        code = ending.code if isinstance(ending.code, int) else 1
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


if __name__ == "__main__":
    sys.path.insert(0, sys.argv[1])
    serve(Path(sys.argv[2]))
