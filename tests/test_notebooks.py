"""The notebooks run from start to end, without keys, as they are committed."""

import ast
import re
from pathlib import Path
from typing import Any

import nbformat
import pytest

import falsifier
from tests.notebooks import NOTEBOOKS, execute, read

# Bytes of all notebooks together, outputs included.
MOST_BYTES = 1_500_000
ABSOLUTE_PATH = re.compile(r"(?:^|[\s'\"(=])/\w[\w.-]*/\w", re.MULTILINE)
PYTHON_BLOCK = re.compile(r"```python\n(.*?)```", re.DOTALL)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_start_to_end(path: Path, tmp_path: Path) -> None:
    execute(read(path), tmp_path)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_committed_executed_without_own_paths_and_imports_from_the_door(path: Path) -> None:
    notebook = read(path)
    nbformat.validate(notebook)
    counts = [cell.execution_count for cell in notebook.cells if cell.cell_type == "code"]
    assert counts == list(range(1, len(counts) + 1))
    texts = [text for cell in notebook.cells for output in cell.get("outputs", ()) for text in said(output)]
    assert texts and not [text for text in texts if ABSOLUTE_PATH.search(text)]
    imported = {name for code in programs(notebook) for name in imports(code)}
    assert imported and imported <= set(dir(falsifier))


def test_there_are_notebooks_and_they_are_small() -> None:
    assert len(NOTEBOOKS) == 5
    assert sum(path.stat().st_size for path in NOTEBOOKS) < MOST_BYTES


def said(output: Any) -> list[str]:
    """Texts of an output, in all forms but pictures."""
    texts = [value for kind, value in output.get("data", {}).items() if kind.startswith("text/")]
    return [*texts, *([output["text"]] if "text" in output else [])]


def programs(notebook: Any) -> list[str]:
    """Python of the code cells, without commands of the notebook, and of the examples in between."""
    cells = [cell.source for cell in notebook.cells if cell.cell_type == "code"]
    code = ["\n".join(line for line in cell.splitlines() if line[:1] not in ("%", "!")) for cell in cells]
    told = [cell.source for cell in notebook.cells if cell.cell_type == "markdown"]
    return code + [block for text in told for block in PYTHON_BLOCK.findall(text)]


def imports(code: str) -> list[str]:
    """What is imported of this package: names from the door, or a module's whole name."""
    found = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names if alias.name.startswith("falsifier.")]
        elif isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "falsifier":
            found += [a.name if node.module == "falsifier" else f"{node.module}.{a.name}" for a in node.names]
    return found
