"""The architecture, read from the imports: every module imports from its own room or from those above it."""

import ast
import re
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import falsifier

PACKAGE = Path(falsifier.__file__).parent
# The one place that says which rooms there are, and in which order.
ROOMS = re.findall(r"^    ([a-z]+)/ ", falsifier.__doc__ or "", re.MULTILINE)
RANK = {name: rank for rank, name in enumerate(("errors", *ROOMS, "testing"))}
# Who may import these, always inside a function.
HEAVY = {"rtamt": "stl/second_monitor.py", "litellm": "llm", "matplotlib": "views/plotting"}
DOOR = ("__init__", "__main__")


@cache
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
            found += [(f"{node.module}.{alias.name}", node in at_import) for alias in node.names]
    return found


def sources() -> list[Path]:
    return sorted(p for p in PACKAGE.rglob("*.py"))


def room(path: Path) -> str:
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def test_the_house_has_the_rooms_that_the_door_lists() -> None:
    assert len(ROOMS) == 15
    assert {room(p) for p in sources()} == {*RANK, *DOOR}


def test_imports_point_upwards_in_the_list() -> None:
    wrong = []
    for path in sources():
        if room(path) in DOOR:
            continue
        for module, _ in imports(path):
            parts = module.split(".")
            if parts[0] == "falsifier" and len(parts) > 1 and RANK.get(parts[1], -1) > RANK[room(path)]:
                wrong.append(f"{path.relative_to(PACKAGE)} imports {module}")
    assert not wrong, "\n".join(wrong)


def module_name(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def test_there_is_no_circle() -> None:
    """Behind the door: whoever imports any module, in a function or not, never comes back to it."""
    modules = {module_name(p): p for p in sources() if room(p) not in DOOR}
    graph = {name: {m for m, _ in imports(path) if m in modules} for name, path in modules.items()}
    for name, imported in graph.items():  # a package through which one of its modules is imported is no step
        parts = name.split(".")
        imported -= {name}
        imported -= (
            {".".join(parts[:n]) for n in range(1, len(parts))} if modules[name].stem != "__init__" else set()
        )
    TopologicalSorter(graph).prepare()


EXPORT = PACKAGE.parent / "modelica" / "export"


def relative_imports(path: Path) -> set[Path]:
    """The files of the exporter that a file of it imports, also for type checkers."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level:
            folder = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            found |= {folder.with_suffix(".py"), *(folder / f"{alias.name}.py" for alias in node.names)}
    return {file for file in found if file.is_file()}


def test_the_exporter_and_the_product_import_nothing_of_each_other_and_it_has_no_circle() -> None:
    files = sorted(EXPORT.rglob("*.py"))
    of_exporter = {module.split(".")[0] for path in files for module, _ in imports(path)}
    of_product = {module.split(".")[0] for path in sources() for module, _ in imports(path)}
    assert "falsifier" not in of_exporter and not {"modelica", "export"} & of_product
    graph = {path: relative_imports(path) for path in files}
    assert sum(map(len, graph.values())) > 100
    TopologicalSorter(graph).prepare()


def test_heavy_packages_are_imported_in_one_place_inside_functions() -> None:
    found = set()
    for path in sources():
        for module, at_import in imports(path):
            package = module.split(".")[0]
            found.add(package)
            if package in HEAVY:
                place = path.relative_to(PACKAGE).as_posix()
                assert place.startswith(HEAVY[package]), f"{place} imports {package}"
                assert not at_import, f"{place} imports {package} at import time"
    assert found >= HEAVY.keys()


def test_importing_the_package_and_the_usual_engine_imports_nothing_heavy() -> None:
    code = (
        "import sys, falsifier.engines.surrogate; from falsifier import load_problem, FunctionModel; "
        "heavy = ('cma', 'fmpy', 'rtamt', 'litellm', 'matplotlib', 'scipy'); "
        "print([m for m in heavy if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
