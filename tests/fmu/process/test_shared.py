import os

import pytest

from falsifier.fmu.process.shared import _DROPPED, _MOST_BYTES, Output


def prints(output: Output, text: bytes) -> int:
    return os.write(output.fileno(), text)


def test_lines_are_taken_once() -> None:
    output = Output()
    assert output.take() == ()
    prints(output, b"one\ntwo")
    assert output.take() == ("one", "two")
    assert output.take() == ()
    prints(output, b"three\n")
    assert output.take() == ("three",)
    output.close()


def test_of_much_output_the_end_is_taken() -> None:
    output = Output()
    prints(output, b"first\n" + b"x" * 100_000 + b"\nlast\n")
    lines = output.take()
    assert lines[-1] == "last"
    assert "first" not in lines
    output.close()


def test_no_process_can_make_it_longer_or_shorter() -> None:
    output = Output()
    written = 0
    with pytest.raises(PermissionError):
        while True:
            written += prints(output, b"x" * 99_999)
    assert written == _MOST_BYTES
    for size in (0, 2 * _MOST_BYTES):
        with pytest.raises(PermissionError):
            os.ftruncate(output.fileno(), size)
    assert output.take()[-1] == _DROPPED
    prints(output, b"again\n")
    assert output.take() == ("again",)
    output.close()


@pytest.mark.parametrize("position", [1, _MOST_BYTES, 1 << 60])
def test_a_moved_position_does_no_harm(position: int) -> None:
    output = Output()
    os.lseek(output.fileno(), position, os.SEEK_SET)
    assert sum(map(len, output.take())) < _MOST_BYTES
    prints(output, b"again\n")
    assert output.take() == ("again",)
    output.close()
