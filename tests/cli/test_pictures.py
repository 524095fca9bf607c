"""Pictures that commands write replace only pictures that commands have written."""

from pathlib import Path

import pytest
from matplotlib.figure import Figure

from falsifier.cli.files import checked_picture
from falsifier.errors import SpecError
from falsifier.views.plotting.axes import save_figure


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_only_our_pictures_are_replaced(ending: str, tmp_path: Path) -> None:
    picture = tmp_path / f"picture.{ending}"
    save_figure(Figure(), picture)
    assert checked_picture(picture) == picture
    Figure().savefig(picture)
    with pytest.raises(SpecError, match="exists and is kept"):
        checked_picture(picture)
