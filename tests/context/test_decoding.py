import pytest

from falsifier.context.decoding import text_of


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-32", "latin-1"])
def test_text_is_read_in_the_encodings_that_tools_write(encoding: str) -> None:
    assert text_of("limit = 64 °C".encode(encoding)) == "limit = 64 °C"


@pytest.mark.parametrize("mark", [b"\xfe\xff", b"\x00\x00\xfe\xff"])
def test_marks_of_big_endian_text(mark: bytes) -> None:
    assert text_of(mark + "5 K".encode("utf-16-be" if len(mark) == 2 else "utf-32-be")) == "5 K"


@pytest.mark.parametrize("content", [b"\x7fELF\0\1", b"\xff\xfe\0", b"\xef\xbb\xbf\xff", b"\xff\xfe\0\0\xff"])
def test_binary_data_is_no_text(content: bytes) -> None:
    assert text_of(content) is None


def test_quotes_and_dashes_of_windows_are_kept() -> None:
    assert text_of("limit – 5 “km/h”".encode("cp1252")) == "limit – 5 “km/h”"


def test_what_has_control_characters_and_is_not_utf_8_is_binary() -> None:
    assert text_of(bytes(range(1, 256))) is None
