"""Texts of a figure: on the canvas, and none on another."""

from itertools import combinations

from matplotlib.text import Text
from mpl_toolkits.mplot3d.art3d import Text3D
from mpl_toolkits.mplot3d.proj3d import proj_transform


def texts_of(figure):
    """All texts that are seen, with what they take of the canvas."""
    axes = [
        getattr(a, f"{name}axis")
        for a in figure.axes
        for name in "xyz"
        if hasattr(a, name + "axis")
    ]
    every = {label for axis in axes for label in axis.get_ticklabels(which="both")}
    ticks = [tick.label1 for axis in axes if axis.axes.axison for tick in axis._update_ticks()]
    found = [text for text in figure.findobj(Text) if text not in every] + ticks
    seen = [text for text in found if text.get_visible() and text.get_text().strip()]
    for text in seen:
        if isinstance(text, Text3D):
            # Its place on the canvas is known only while it is drawn.
            x, y, _ = proj_transform(*text.get_position_3d(), text.axes.get_proj())
            Text.set_position(text, (x, y))
    return [(text, Text.get_window_extent(text)) for text in seen]


def check_texts(figure):
    texts = texts_of(figure)
    canvas = figure.bbox.padded(1.0)
    for text, box in texts:
        assert canvas.x0 <= box.x0, text
        assert canvas.y0 <= box.y0, text
        assert box.x1 <= canvas.x1, text
        assert box.y1 <= canvas.y1, text
    for (one, first), (other, second) in combinations(texts, 2):
        assert not first.padded(-1.0).overlaps(second.padded(-1.0)), (one, other)
