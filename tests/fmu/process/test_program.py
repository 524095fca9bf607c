"""The program that runs FMUs."""

import hashlib

from falsifier.fmu.process.connection import Request, Where
from falsifier.fmu.process.reuse import REUSES
from falsifier.fmu.process.start import WORKER


def test_the_worker_is_built_from_its_sources() -> None:
    """`make worker` writes the sums of both."""
    lines = [line.split() for line in (WORKER / "SHA256SUMS").read_text().splitlines()]
    sums = {name: digest for digest, name in lines}
    files = {str(path.relative_to(WORKER)) for path in WORKER.rglob("*") if path.is_file()}
    assert sums.keys() == files - {"SHA256SUMS"}
    for name, expected in sums.items():
        assert hashlib.sha256((WORKER / name).read_bytes()).hexdigest() == expected, name


def numbered(source: str, enum: str) -> dict[str, int]:
    """What an enumeration of the sources says."""
    text = (WORKER / source).read_text().partition(f"enum {enum} {{")[2].partition("}")[0]
    names = "".join(line.split("/*")[0] for line in text.splitlines()).split(",")
    found, number = {}, 0
    for name, _, given in (each.partition("=") for each in names if each.strip()):
        number = int(given) if given else number
        found[name.strip()] = number
        number += 1
    return found


def test_places_and_requests_are_numbered_as_in_the_worker() -> None:
    assert numbered("worker.h", "where") == {where.name: int(where) for where in Where}
    assert numbered("main.c", "kind") == {kind.name: int(kind) for kind in Request}
    ways = numbered("session.h", "reuse")
    assert [f"BY_{reuse.upper()}" for reuse in REUSES] == list(ways)[:-1]
