import numpy as np
import pytest

from falsifier.fmu.tasks import room_for


@pytest.mark.parametrize(("pieces", "room"), [([], 1), ([1], 1), ([3, 2], 4), ([4], 4), ([5], 8)])
def test_a_few_plans_suffice_for_any_number_of_pieces(pieces: list[int], room: int) -> None:
    assert room_for([np.zeros((n, 5)) for n in pieces]) == room
