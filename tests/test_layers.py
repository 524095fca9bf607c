"""The architecture, read from the imports: every module imports from its own layer or from below only."""

import ast
import subprocess
import sys
from pathlib import Path

import falsifier

PACKAGE = Path(falsifier.__file__).parent
LAYERS = [
    ("values", ["errors", "signals", "space", "trajectory"]),
    ("meaning", ["model", "stl", "fmu", "spec", "ranges", "loading", "problem", "adhoc"]),
    ("evaluate", ["evaluation", "execution"]),
    ("search", ["llm", "proposers"]),
    (
        "run",
        [
            "budget",
            "check",
            "confirm",
            "counterexamples",
            "engine",
            "events",
            "journal",
            "neighbourhood",
            "manifest",
            "request",
            "result",
            "session",
            "shrink",
            "wiring",
            "simplicity",
        ],
    ),
    ("campaign", ["analysis", "campaign"]),
    (
        "faces",
        [
            "archcomp",
            "cli",
            "display",
            "explain",
            "export",
            "notebook",
            "panels",
            "plotting",
            "report",
            "scoreboard",
            "testing",
        ],
    ),
]
RANK = {module: rank for rank, (_, modules) in enumerate(LAYERS) for module in modules}
HEAVY = {"fmpy": "fmu", "rtamt": "stl/reference.py", "litellm": "llm", "matplotlib": "plotting"}


def imports(path: Path) -> list[tuple[str, bool]]:
    """Imported modules of a file, and whether at import time."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    at_import: set[ast.AST] = set()
    queue: list[ast.AST] = [tree]
    while queue:
        node = queue.pop()
        for child in ast.iter_child_nodes(node):
            guarded = isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test)
            if not isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda) and not guarded:
                at_import.add(child)
                queue.append(child)
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found += [(alias.name, node in at_import) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.append((node.module, node in at_import))
            if node.module == "falsifier":
                found += [(f"falsifier.{alias.name}", node in at_import) for alias in node.names]
    return found


def sources() -> list[Path]:
    return sorted(p for p in PACKAGE.rglob("*.py"))


def room(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def test_every_module_has_a_layer() -> None:
    unknown = {room(p) for p in sources()} - set(RANK) - {"__init__", "__main__"}
    assert not unknown, f"say in LAYERS where these belong: {unknown}"


def test_imports_point_downwards() -> None:
    upward = []
    for path in sources():
        if room(path) in ("__init__", "__main__"):
            continue
        for module, at_import in imports(path):
            parts = module.split(".")
            if parts[0] != "falsifier" or len(parts) < 2 or parts[1] not in RANK or not at_import:
                continue
            if RANK[parts[1]] > RANK[room(path)]:
                upward.append(f"{path.relative_to(PACKAGE)} imports {module}")
    assert not upward, upward


def test_llm_knows_nothing_of_proposers() -> None:
    for path in (PACKAGE / "llm").rglob("*.py"):
        assert not [m for m, _ in imports(path) if m.startswith("falsifier.proposers")], path


def test_heavy_packages_are_imported_in_one_place_inside_functions() -> None:
    for path in sources():
        for module, at_import in imports(path):
            package = module.split(".")[0]
            if package in HEAVY:
                place = path.relative_to(PACKAGE).as_posix()
                assert place.startswith(HEAVY[package]), f"{place} imports {package}"
                assert not at_import, f"{place} imports {package} at import time"


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = (
        "import sys, falsifier; from falsifier import load_problem, falsify, FunctionModel; "
        "print([m for m in ('fmpy', 'rtamt', 'litellm', 'matplotlib', 'numba', 'scipy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
