import json
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from falsifier.core.sealing import check_seal, checksum, seal


@given(st.dictionaries(st.text(), st.integers() | st.text(), min_size=1), st.sampled_from([None, 2]))
def test_a_sealed_object_is_the_object_and_its_checksum(
    content: dict[str, object], indent: int | None
) -> None:
    sealed = seal(json.dumps(content, indent=indent))
    check_seal(sealed.encode())
    loaded = json.loads(sealed)
    assert list(loaded)[-1] == "sum"
    assert {**content, "sum": loaded["sum"]} == loaded


def test_every_flipped_bit_but_in_the_last_blanks_is_noticed() -> None:
    sealed = seal('{"a":1,"b":"text"}').encode()
    for position in range(8 * (len(sealed) - 1)):
        damaged = bytearray(sealed)
        damaged[position // 8] ^= 1 << position % 8
        with pytest.raises(ValueError, match="checksum"):
            check_seal(bytes(damaged))


def test_what_has_no_checksum_is_refused() -> None:
    for content in (b"", b"{}", b'{"a":1}', Random(1).randbytes(1000)):
        with pytest.raises(ValueError, match="does not end with a checksum"):
            check_seal(content)
    assert checksum(b"") != checksum(b"0")
