import hashlib
from pathlib import Path

import pytest

from falsifier.errors import ModelError
from falsifier.fmu import folders, wine_process
from falsifier.fmu.description import wine
from tests import patience
from tests.fmu.test_wine_instance import needs_wine

_FOLDER = wine_process.WORKER.parents[2]


def test_the_worker_is_built_from_its_sources() -> None:
    """`make worker` writes the sums of both."""
    lines = [line.split() for line in (_FOLDER / "SHA256SUMS").read_text().splitlines()]
    sums = {name: digest for digest, name in lines}
    files = {str(path.relative_to(_FOLDER)) for path in _FOLDER.rglob("*") if path.is_file()}
    assert sums.keys() == files - {"SHA256SUMS"}
    for name, expected in sums.items():
        assert hashlib.sha256((_FOLDER / name).read_bytes()).hexdigest() == expected, name


def test_places_and_requests_are_numbered_as_in_the_worker() -> None:
    header = (_FOLDER / "worker.h").read_text()
    names = [
        line.split("/*")[0] for line in header.partition("enum where {")[2].partition("}")[0].splitlines()
    ]
    words = [word.strip() for word in "".join(names).split(",")]
    assert words[:8] == [
        "DONE",
        "SETTING",
        "STEPPING",
        "GETTING",
        "EVENT",
        "TERMINATED",
        "STUCK",
        "TOO_SMALL",
    ]
    assert words[8:] == [
        "CALLING = 20", "WRITING", "TEXT", "TIMEOUT", "IMPOSSIBLE", "REFUSED", "MESSAGE", "CRASHED",
    ]  # fmt: skip


def test_wine_gets_no_keys_and_no_screen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "sk-secret")
    monkeypatch.setenv("DISPLAY", ":0")
    environment = wine_process._environment(tmp_path, tmp_path / "prefix")
    assert not {"OPENAI_API_KEY", "DISPLAY"} & environment.keys()
    assert environment["WINEPREFIX"] == str(tmp_path / "prefix")


def test_no_wine_is_said_before_anything_is_written(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr("shutil.which", lambda _: None)
    with pytest.raises(ModelError, match="Wine, which is missing: install Wine"):
        wine_process.WineProcess(tmp_path, print)
    assert list(tmp_path.iterdir()) == []
    assert "which is missing" in wine.windows_text()


def processes_in(folder: Path) -> list[str]:
    """Programs whose environment names a folder."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            if str(folder).encode() in (entry / "environ").read_bytes():
                found.append((entry / "comm").read_text().strip())
        except OSError:
            continue
    return found


@needs_wine
def test_nothing_is_left_of_a_wine_that_was_closed(tmp_path: Path) -> None:
    process = wine_process.WineProcess(tmp_path, print)
    assert processes_in(process.folder)
    unknown = process.request(99)
    assert unknown.text == "request 99 is unknown"
    process.close()
    assert list(tmp_path.iterdir()) == []
    patience.wait_until(lambda: not processes_in(process.folder))


@pytest.mark.parametrize(("code", "ending"), [(-9, 9), (0xC0000005, 11)])
def test_this_process_does_not_end_while_its_folder_is_removed(
    monkeypatch: pytest.MonkeyPatch, code: int, ending: int
) -> None:
    process = object.__new__(wine_process.WineProcess)
    process._connected = True
    said: list[tuple[int, bool]] = []

    def end_by(number: int) -> None:
        said.append((number, folders.REMOVING.locked()))
        raise InterruptedError

    monkeypatch.setattr("falsifier.core.linux.end_by", end_by)
    with pytest.raises(InterruptedError):
        process._end_alike(code)
    assert said == [(ending, True)]
