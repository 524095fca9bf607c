"""What can be said of the Windows modules without Windows: they offer what the others offer."""

import ast
from pathlib import Path

import pytest

from falsifier.core import operating_system

CORE = Path(operating_system.__file__).parent


def tree(name: str) -> ast.Module:
    return ast.parse((CORE / f"{name}.py").read_text(encoding="utf-8"))


def functions(body: list[ast.stmt]) -> dict[str, str]:
    """Signatures of the public functions and methods, by name."""
    found: dict[str, str] = {}
    for node in body:
        if isinstance(node, ast.ClassDef):
            found |= {f"{node.name}.{name}": text for name, text in functions(node.body).items()}
        elif isinstance(node, ast.FunctionDef) and (node.name == "__init__" or node.name[0] != "_"):
            found[node.name] = (
                f"{ast.unparse(node.args)} -> {ast.unparse(node.returns or ast.Constant(None))}"
            )
    return {name: text for name, text in found.items() if not name.startswith("_")}


@pytest.mark.parametrize(("windows", "other"), [("windows", "posix"), ("windows_files", "posix_files")])
def test_windows_offers_the_same_functions(windows: str, other: str) -> None:
    assert functions(tree(windows).body) == functions(tree(other).body)


def test_all_that_is_offered_is_passed_on() -> None:
    offered = functions(tree("windows").body) | functions(tree("windows_files").body)
    assert {name.partition(".")[0] for name in offered} <= vars(operating_system).keys()
