from pathlib import Path

import pytest

from falsifier.context import files
from falsifier.context.files import Sentry, inside, text_of
from falsifier.errors import SpecError
from tests.fixtures.archives import packed


def write(path: Path, **more: str) -> Path:
    files = {
        "modelDescription.xml": "<x/>",
        "documentation/index.html": "<p>hello</p>",
        "documentation/logo.png": "x",
        "sources/model.c": "int a;",
        "sources/fmi2Functions.h": "int b;",
        "resources/map.txt": "1 2",
        "resources/map.csv": "1,2",
        "binaries/linux64/m.so": "x",
    } | more
    return packed(path, files)


def test_only_what_may_say_something_is_opened(tmp_path: Path) -> None:
    found = dict(inside(write(tmp_path / "m.fmu")))
    assert sorted(found) == ["documentation/index.html", "resources/map.txt", "sources/model.c"]
    assert found["sources/model.c"] == b"int a;"


def test_too_large_too_many_and_damaged_are_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SpecError, match=r"m\.fmu: documentation/a\.md has 5 MiB, more than 4"):
        list(inside(write(tmp_path / "m.fmu", **{"documentation/a.md": "x" * (5 << 20)})))
    monkeypatch.setattr(files, "_MAX_FILES", 2)
    with pytest.raises(SpecError, match="3 documents and sources, more than 2"):
        list(inside(write(tmp_path / "m.fmu")))


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32", "latin-1"])
def test_text_is_read_in_the_encodings_that_tools_write(encoding: str) -> None:
    assert text_of("limit = 64 °C".encode(encoding)) == "limit = 64 °C"


@pytest.mark.parametrize("end", ["\r\n", "\r"])
def test_lines_end_as_here_whichever_machine_wrote_them(end: str) -> None:
    assert text_of(f"#define LIMIT \\{end} 3{end}".encode()) == "#define LIMIT \\\n 3\n"


@pytest.mark.parametrize("mark", [b"\xfe\xff", b"\x00\x00\xfe\xff"])
def test_marks_of_big_endian_text(mark: bytes) -> None:
    assert text_of(mark + "5 K".encode("utf-16-be" if len(mark) == 2 else "utf-32-be")) == "5 K"


@pytest.mark.parametrize(
    "content",
    [
        b"%PDF-1.7\n1 0 obj",
        b"{\\rtf1\\ansi x}",
        b"\x7fELF\0\1",
        b"\xff\xfe\0",
        b"\xef\xbb\xbf\xff",
        b"\xff\xfe\0\0\xff",
        bytes(range(1, 256)),  # no zero, but control characters
    ],
)
def test_binary_data_is_no_text(content: bytes) -> None:
    assert text_of(content) is None


def test_the_value_of_a_key_is_never_allowed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLANT_API_KEY", "quite an ordinary value")
    with pytest.raises(SpecError, match=r"a\.md: line 1 has the value of an environment variable"):
        Sentry(["a.md"]).look("quite an ordinary value", "a.md", "a.md", "leave it out")


def test_a_checked_name_that_is_not_read_is_refused() -> None:
    sentry = Sentry(["a.md", "misspelt.md"])
    sentry.look("fine", "a.md", "a.md", "leave it out")
    with pytest.raises(SpecError, match=r"checked names misspelt\.md"):
        sentry.refuse_unused()
