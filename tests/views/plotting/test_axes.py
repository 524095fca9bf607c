from matplotlib.figure import Figure

from falsifier.views.plotting.axes import figure_of, own_axes


def test_axes_of_ones_own_fill_a_figure_of_the_size() -> None:
    ax = own_axes(5.0, 3.0)
    figure = figure_of(ax)
    assert figure.axes == [ax]
    assert figure.get_size_inches().tolist() == [5.0, 3.0]


def test_the_figure_of_a_part_is_the_whole() -> None:
    figure = Figure()
    part = figure.add_subfigure(figure.add_gridspec(1, 2)[0])
    assert figure_of(part.subplots()) is figure
