import stat
import zipfile
from pathlib import Path

import pytest

from falsifier.core.files import bundled
from falsifier.errors import ModelError, ModelFileError, SpecError
from falsifier.fmu import read_info
from falsifier.fmu.description import archive, xml
from falsifier.fmu.description.xml import read_xml


def write(path: Path, *entries: tuple[zipfile.ZipInfo | str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as target:
        for entry, data in entries:
            target.writestr(entry, data, zipfile.ZIP_DEFLATED)
    return path


@pytest.mark.parametrize(
    ("names", "what"),
    [
        *(((n,), "outside the folder") for n in ("../evil.txt", "/etc/evil.txt", "a/../../evil.txt")),
        *(((n,), "outside the folder") for n in ("..\\evil.txt", "C:\\evil")),
        *((n, "both a file and a folder") for n in (("a", "a/b"), ("a/b", "a"))),
        *((n, "both a file and a folder") for n in (("a/", "a"), ("x/y", "x/y/z"))),
        *(((n,), "control character") for n in ("a\nb", "a\x1b[31m", "a\x7f")),
        *(((n,), "too long") for n in ("a" * 256, "ü" * 128, "a/" * 1025 + "b")),
    ],
    ids=range(15),
)
def test_names_that_do_harm_are_refused(tmp_path: Path, names: tuple[str, ...], what: str) -> None:
    fmu = write(tmp_path / "evil.fmu", *((name, b"x") for name in names))
    with pytest.raises(ModelFileError, match=what):
        archive.extract(fmu, tmp_path / "deep" / "out")
    assert [path.name for path in tmp_path.iterdir()] == ["evil.fmu"]


@pytest.mark.parametrize(
    ("mode", "what"),
    [
        (stat.S_IFLNK | 0o777, "is a symbolic link"),
        (stat.S_IFIFO | 0o666, "is a named pipe"),
        (stat.S_IFSOCK | 0o666, "is a socket"),
        (stat.S_IFCHR | 0o666, "is a device"),
        (stat.S_IFREG | stat.S_ISUID | 0o755, "setuid"),
    ],
)
def test_only_plain_files_are_accepted(tmp_path: Path, mode: int, what: str) -> None:
    special = zipfile.ZipInfo("resources/passwd")
    special.external_attr = mode << 16
    with pytest.raises(ModelError, match=f"'resources/passwd'.*{what}"):
        archive.extract(write(tmp_path / "special.fmu", (special, b"/etc/passwd")), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_entry_with_more_data_than_it_declares_is_refused(tmp_path: Path) -> None:
    """Data after the declared size would never be checked."""
    path = tmp_path / "hiding.fmu"
    content = bytes(range(256)) * 4096
    with zipfile.ZipFile(path, "w") as target:
        target.writestr("sources/a.c", content)
    data = path.read_bytes()
    for header, at in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        begin = data.index(header) + at
        data = data[:begin] + (1).to_bytes(4, "little") + data[begin + 4 :]
    path.write_bytes(data)
    with pytest.raises(ModelError, match="declares 1 bytes, but 1048576 are stored"):
        archive.extract(path, tmp_path / "out")


def test_a_bomb_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    fmu = tmp_path / "bomb.fmu"
    with zipfile.ZipFile(fmu, "w", zipfile.ZIP_DEFLATED) as target, target.open("zeros", "w") as entry:
        for _ in range(300):
            entry.write(bytes(1 << 20))
    with pytest.raises(ModelError, match="'zeros' grows from"):
        archive.extract(fmu, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_an_absurd_total_size_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive, "_MAX_BYTES", 1000)
    with pytest.raises(ModelError, match="would unpack to"):
        archive.extract(write(tmp_path / "big.fmu", ("a", bytes(600)), ("b", bytes(600))), tmp_path / "out")


def test_two_entries_of_one_name_are_refused(tmp_path: Path) -> None:
    with pytest.warns(UserWarning, match="Duplicate"):
        fmu = write(tmp_path / "twice.fmu", ("a", b"1"), ("a", b"2"))
    with pytest.raises(ModelError, match="'a' 2 times"):
        archive.extract(fmu, tmp_path / "out")


def test_what_is_not_an_fmu_is_named(tmp_path: Path) -> None:
    (tmp_path / "text.fmu").write_text("hello")
    with pytest.raises(ModelError, match=r"text\.fmu: not a readable FMU"):
        read_info(tmp_path / "text.fmu")
    with pytest.raises(ModelError, match=r"none\.fmu: cannot be read"):
        read_info(tmp_path / "none.fmu")
    with pytest.raises(ModelError, match=r"no modelDescription\.xml"):
        read_info(write(tmp_path / "zip.fmu", ("a.txt", b"x")))


def test_damaged_data_is_no_fmu_as_a_file_that_is_cut_off(tmp_path: Path) -> None:
    data = bytearray((bundled("fmus") / "AT.fmu").read_bytes())
    start = data.index(b"modelDescription.xml") + 60
    (tmp_path / "cut.fmu").write_bytes(data[:5000])
    data[start : start + 40] = b"\xff" * 40
    (tmp_path / "damaged.fmu").write_bytes(data)
    for name in ("cut", "damaged"):
        with pytest.raises(ModelFileError, match=rf"{name}\.fmu: .*(damaged|not a readable FMU)"):
            read_info(tmp_path / f"{name}.fmu")


@pytest.mark.parametrize(("header", "name_at"), [(b"PK\x03\x04", 30), (b"PK\x01\x02", 46)])
def test_a_name_in_no_encoding_is_damage(tmp_path: Path, header: bytes, name_at: int) -> None:
    path = write(tmp_path / "named.fmu", ("modelDescription.xmlü", b"<a/>"))
    data = bytearray(path.read_bytes())
    end = data.index(header) + name_at + 21
    data[end - 1 : end + 1] = b"\xff\xff"
    path.write_bytes(data)
    with pytest.raises(ModelError, match=r"named\.fmu: .*(damaged|not a readable FMU)"):
        archive.read_entry(path, "modelDescription.xmlü")


LAUGHS = b"""<!DOCTYPE x [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]><x>&b;</x>"""
OUTSIDE = b"""<!DOCTYPE x SYSTEM "file:///etc/passwd"><x/>"""


def test_document_types_are_refused_and_what_is_not_well_formed_is_named() -> None:
    for text in (LAUGHS, OUTSIDE, OUTSIDE.decode().encode("utf-16")):
        with pytest.raises(SpecError, match=r"part: refused because it declares a document type \(x\)"):
            read_xml(text, "part", SpecError)
    for text in (b"<a><b></a>", b"", b"<?xml version='1.0' encoding='no'?><a/>", b"<a>&x;</a>"):
        with pytest.raises(SpecError, match="part: not well-formed XML"):
            read_xml(text, "part", SpecError)


def test_depth_and_size_have_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SpecError, match="nested more than 400 deep"):
        read_xml(b"<a>" * 500 + b"</a>" * 500, "part", SpecError)
    assert read_xml(b"<a>" * 300 + b"</a>" * 300, "part", SpecError).tag == "a"
    monkeypatch.setattr(xml, "_MAX_SIGNS", 3)
    with pytest.raises(ModelError, match="more than 3 tags"):
        read_xml(b"<a><b/><b/><b/></a>", "part", ModelError)
