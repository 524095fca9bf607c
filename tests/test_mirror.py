"""Tests mirror the source: ``falsifier/a/b.py`` is tested in ``tests/a/test_b.py``.

Tests of several modules together stand beside these under names of their own.
"""

import ast
from pathlib import Path

import pytest

import falsifier

PACKAGE = Path(falsifier.__file__).parent
TESTS = Path(__file__).parent
MODULES = sorted(p.relative_to(PACKAGE) for p in PACKAGE.rglob("*.py"))

# Pure declarations, which do nothing that could be tested.
DECLARATIONS = {
    "engines/adviser.py": "a protocol",
    "engines/protocol.py": "protocols",
    "engines/surrogate/settings.py": "numbers with their reasons",
    "fmu/loop_numbers.py": "numbers",
    "fmu/slot.py": "a record",
    "fmu/worker_order.py": "a record",
    "llm/prompts/blocks.py": "records",
    "search/events.py": "records",
    "stl/opcodes.py": "numbers",
}
# Packages whose __init__.py does more than pass names on.
PACKAGES = {
    ".": "test_door.py",
    "cli": "test_cli.py",
    "counterexamples/export": "test_export.py",
}


def namesake(module: Path) -> Path:
    """Test file of a module, relative to the tests."""
    if module.name == "__init__.py":
        return module.parent / PACKAGES.get(module.parent.as_posix(), "")
    return module.with_name(f"test_{module.stem.strip('_')}.py")


def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def does_something(node: ast.AST) -> bool:
    """Whether a definition has a body beyond its docstring."""
    if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
        return False
    return any(not (isinstance(s, ast.Expr) and isinstance(s.value, ast.Constant)) for s in node.body)


def passes_names_on(path: Path) -> bool:
    """Whether a module only imports names and lists them."""
    return all(
        isinstance(s, ast.Import | ast.ImportFrom | ast.Expr)
        or (isinstance(s, ast.If) and ast.unparse(s.test) == "TYPE_CHECKING")
        or (isinstance(s, ast.Assign) and ast.unparse(s.targets[0]) == "__all__")
        for s in tree(path).body
    )


@pytest.mark.parametrize("module", MODULES, ids=lambda m: m.as_posix())
def test_a_module_has_its_tests_where_they_are_looked_for(module: Path) -> None:
    if module.as_posix() in DECLARATIONS:
        return
    if module.name == "__init__.py" and module.parent.as_posix() not in PACKAGES:
        assert passes_names_on(PACKAGE / module), (
            f"{module} does something: add it to PACKAGES with its tests"
        )
        return
    file = TESTS / namesake(module)
    assert file.is_file(), f"write tests/{namesake(module).as_posix()}; pure declarations go to DECLARATIONS"
    names = [getattr(node, "name", "") for node in ast.walk(tree(file))]
    assert any(name.startswith("test_") for name in names) or "TestContract" in names


@pytest.mark.parametrize("module", DECLARATIONS)
def test_declarations_do_nothing(module: str) -> None:
    assert not (TESTS / namesake(Path(module))).exists(), "it has tests: take it out of DECLARATIONS"
    assert not [node.name for node in ast.walk(tree(PACKAGE / module)) if does_something(node)]  # type: ignore[attr-defined]
