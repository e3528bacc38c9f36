"""Figures as pictures."""

from dataclasses import replace

import matplotlib as mpl
from drawing import a_figure, png_size
from matplotlib.legend import Legend

from chefshat.learn import plots
from chefshat.learn.figures import Figure, Line, Panel


def test_a_plot_is_deterministic() -> None:
    figure = a_figure()
    picture = plots.png(figure)
    width, height = png_size(picture)
    assert width > 2 * height > 400
    assert picture == plots.png(figure)
    other = replace(figure, panels=figure.panels[:1])
    assert png_size(plots.png(other))[0] < width


def test_legends_do_not_cover_lines() -> None:
    figure = a_figure()
    names = [[text.get_text() for text in legend.get_texts()] for legend in legends_beside_panels(figure)]
    assert names == [["learner", "paper"], ["ours"]]
    # If each name has one line style and each style one name, all panels share a legend.
    panels = [figure.panels[0], replace(figure.panels[0], levels=())]
    (legend,) = legends_beside_panels(replace(figure, panels=panels))
    assert [text.get_text() for text in legend.get_texts()] == ["learner", "paper"]


def test_legends_with_long_labels_stay_in_the_picture() -> None:
    labels = [" ".join([word] * letters) for word, letters in [("width", 18), ("rate", 40), ("steps", 1)]]
    panel = Panel("Over time", "decisions", "points", lines=[Line(label, [1, 2], [0, 1]) for label in labels])
    for panels in ([panel], [panel, panel]):
        for legend in legends_beside_panels(Figure("curves", "All of it", panels)):
            assert [text.get_text().replace("\n", " ") for text in legend.get_texts()] == labels


def legends_beside_panels(figure: Figure) -> list[Legend]:
    """Returns the legends of a figure. None touches a panel or leaves the picture."""
    with mpl.rc_context(plots.STYLE):
        canvas = plots.drawn(figure)
        canvas.canvas.draw()
    found = [*canvas.legends, *(legend for axes in canvas.axes if (legend := axes.get_legend()))]
    for legend in found:
        place = legend.get_window_extent()
        assert not any(place.overlaps(axes.get_window_extent()) for axes in canvas.axes)
        assert canvas.bbox.containsx(place.x0)
        assert canvas.bbox.containsx(place.x1)
        assert canvas.bbox.containsy(place.y0)
        assert canvas.bbox.containsy(place.y1)
    return found
