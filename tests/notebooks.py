"""Execute the notebooks and store their outputs: ``python -m tests.notebooks [NAME ...]``."""

import asyncio
import os
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import nbformat
import pytest
from jupyter_client.kernelspec import KernelSpec
from jupyter_client.manager import AsyncKernelManager
from nbclient import NotebookClient

from tests.patience import HANG

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
# What a front end shows instead of the plain text.
RICH = ("text/html", "text/markdown")


class ThisPython(AsyncKernelManager):
    """Starts kernels with the Python that runs this, whatever kernels the user has installed."""

    @property
    def kernel_spec(self) -> KernelSpec:
        """A kernel without an entry in anyone's home."""
        command = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
        return KernelSpec(argv=command, language="python", display_name="Python 3")


def read(path: Path) -> Any:
    """Read a notebook."""
    return nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]


def execute(notebook: Any, folder: Path) -> None:
    """Run all cells in a folder; outputs are put into the notebook.

    Raises:
        CellExecutionError: for the first cell that fails.
    """
    with pytest.MonkeyPatch.context() as patch:
        # Kernels find this checkout, and leave nothing in the user's home.
        patch.setenv("PYTHONPATH", str(ROOT), prepend=os.pathsep)
        for name in ("IPYTHONDIR", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR"):
            patch.setenv(name, str(folder / name.lower()))
        resources = {"metadata": {"path": str(folder)}}
        client = NotebookClient(
            notebook,
            kernel_manager_class=ThisPython,
            timeout=int(HANG),
            resources=resources,
            record_timing=False,
        )
        asyncio.run(client.async_execute())


def store(notebook: Any, path: Path) -> None:
    """Write an executed notebook without what differs from machine to machine.

    The plain text of a value that is shown in another form is its type: the rest names files of this machine.
    """
    notebook.metadata = {
        "kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"},
        "language_info": {"name": "python"},
    }
    for cell in notebook.cells:
        cell.metadata = {}
        for output in cell.get("outputs", ()):
            data = output.get("data", {})
            if any(kind in data for kind in RICH) and "text/plain" in data:
                data["text/plain"] = data["text/plain"].partition("(")[0]
    nbformat.validate(notebook)
    nbformat.write(notebook, path)  # type: ignore[no-untyped-call]


if __name__ == "__main__":
    for path in NOTEBOOKS:
        if not sys.argv[1:] or path.stem in sys.argv[1:]:
            notebook = read(path)
            with TemporaryDirectory() as folder:
                execute(notebook, Path(folder))
            store(notebook, path)
            print(f"{path.relative_to(ROOT)} executed")
