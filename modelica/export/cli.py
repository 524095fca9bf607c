"""Command line of the exporter."""

from __future__ import annotations

import argparse
import hashlib
import sys
import tomllib
from pathlib import Path

from .emit.model import model_c, sizes_h
from .flat.evaluate import Evaluator
from .flat.flatten import flatten
from .flat.instance import Scope
from .order.layout import System, lay_out
from .order.sort import sort, sort_initial, states_of
from .pack.description import fmi2, fmi3, model_identifier
from .pack.fmu import PLATFORMS, Contents, build, c_files
from .read.library import absolute, load
from .read.syntax import ExportError

HERE = Path(__file__).parent


SYSTEMS = HERE / "systems.toml"


def translate(source: Path, name: str) -> tuple[System, str]:
    """Translate a Modelica model to the text of model.c.

    Args:
        source: package directory or .mo file.
        name: full name of the model.

    Raises:
        ExportError: with the file and line of what is wrong or not supported.
    """
    root = load(source)
    model = flatten(root, name)
    states = states_of(model)
    system = lay_out(model, states, sort(model, states), sort_initial(model, states))
    scope = absolute(name, root)
    assert scope is not None
    return system, model_c(system, Evaluator(model, Scope(None, scope)))


def export(source: Path, name: str, target: Path, *, version: int, platforms: tuple[str, ...]) -> None:
    """Export one Modelica model as an FMU.

    Args:
        source: package directory or .mo file.
        name: full name of the model.
        target: the .fmu file to write.
        version: FMI version, 2 or 3.
        platforms: platforms to build binaries for.

    Raises:
        ExportError: with the file and line of what is wrong or not supported.
    """
    system, code = translate(source, name)
    description = fmi2(system, c_files(2)) if version == 2 else fmi3(system)
    identifier = model_identifier(system)
    contents = Contents(identifier, version, description, code, sizes_h(system), system.implicit)
    build(contents, target, platforms)


def export_all(folder: Path, names: list[str], platforms: tuple[str, ...]) -> None:
    """Build the FMUs of systems.toml and write SHA256SUMS."""
    table = tomllib.loads(SYSTEMS.read_text(encoding="utf-8"))
    if unknown := sorted(set(names) - set(table)):
        raise ExportError(None, f"systems.toml has no entry {', '.join(unknown)}; it has {', '.join(table)}")
    for name, entry in table.items():
        if names and name not in names:
            continue
        target = folder / entry["file"]
        source = HERE.parent / entry["source"]
        export(source, entry["model"], target, version=entry["fmi"], platforms=platforms)
        print(f"{target}: {target.stat().st_size} bytes")
    write_sums(folder)


def write_sums(folder: Path) -> None:
    """Write the hashes of all FMUs in a folder to SHA256SUMS."""
    lines = [
        f"{hashlib.sha256(f.read_bytes()).hexdigest()}  {f.name}\n" for f in sorted(folder.glob("*.fmu"))
    ]
    (folder / "SHA256SUMS").write_text("".join(lines), encoding="utf-8")


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return its exit code."""
    parser = argparse.ArgumentParser(prog="export_fmu.py", description="Export Modelica models as FMUs.")
    parser.add_argument("model", nargs="?", help="full name of the model, e.g. ArchComp.AT")
    parser.add_argument(
        "--source", type=Path, default=HERE.parent / "ArchComp", help="package directory or .mo file"
    )
    parser.add_argument("--output", type=Path, help="the .fmu file to write (default: the model's name)")
    parser.add_argument("--fmi", type=int, choices=(2, 3), default=2, help="FMI version (default: 2)")
    parser.add_argument(
        "--platform",
        action="append",
        choices=sorted(PLATFORMS),
        help="build for this platform only; repeatable",
    )
    parser.add_argument(
        "--all", type=Path, metavar="FOLDER", help="build all FMUs listed in systems.toml into FOLDER"
    )
    parser.add_argument(
        "--only",
        action="append",
        default=[],
        help="with --all: build only this entry of systems.toml; repeatable",
    )
    given = parser.parse_args(arguments)
    platforms = tuple(given.platform or PLATFORMS)
    try:
        if given.all:
            export_all(given.all, given.only, platforms)
        elif given.model:
            target = given.output or Path(given.model.rsplit(".", 1)[-1] + ".fmu")
            export(given.source, given.model, target, version=given.fmi, platforms=platforms)
        else:
            parser.error("specify a model or --all FOLDER")
    except ExportError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    except RecursionError:
        print("error: a class contains or extends itself, or is nested too deeply", file=sys.stderr)
        return 1
    return 0
