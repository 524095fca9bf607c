from pathlib import Path

import pytest

from falsifier.fmu.sharing import Shared, attach, share_named, share_unnamed


@pytest.mark.parametrize("named", [True, False])
def test_what_one_side_writes_the_other_one_reads(tmp_path: Path, named: bool) -> None:
    shared: Shared = share_named(24, tmp_path) if named else share_unnamed(24)
    attached = attach(shared.place, list(shared.descriptors))
    shared.close()
    assert not list(tmp_path.iterdir())
    assert shared.values.tolist() == [0.0, 0.0, 0.0]
    shared.values[1] = 1.5
    attached[2] = 2.5
    assert shared.values.tolist() == attached.tolist() == [0.0, 1.5, 2.5]
