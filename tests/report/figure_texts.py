"""Figures in tests: whose texts are on the canvas and apart, and errors to draw."""

import numpy as np
import xarray as xr
from matplotlib.text import Text


def texts_of(figure):
    """All texts that are seen, with what they take of the canvas."""
    axes = [axis for panel in figure.axes for axis in (panel.xaxis, panel.yaxis)]
    every = {label for axis in axes for label in axis.get_ticklabels(which="both")}
    ticks = [tick.label1 for axis in axes if axis.axes.axison for tick in axis._update_ticks()]
    found = [text for text in figure.findobj(Text) if text not in every] + ticks
    seen = [text for text in found if text.get_visible() and text.get_text().strip()]
    return [(text, text.get_window_extent()) for text in seen]


def checked(figure):
    """The figure, drawn: no text is cut off or on another, no panel is empty."""
    figure.draw_without_rendering()
    texts = texts_of(figure)
    canvas = figure.bbox.padded(1.0)
    for text, box in texts:
        assert canvas.x0 <= box.x0, text
        assert canvas.y0 <= box.y0, text
        assert box.x1 <= canvas.x1, text
        assert box.y1 <= canvas.y1, text
    low, high = np.moveaxis(np.array([box.padded(-1.0).get_points() for _, box in texts]), 1, 0)
    overlaps = (low[:, None] <= high).all(-1) & (low <= high[:, None]).all(-1)
    pairs = np.argwhere(np.triu(overlaps, k=1))
    assert not len(pairs), [(texts[one][0], texts[other][0]) for one, other in pairs]
    assert all(axis.lines or axis.collections or axis.patches for axis in figure.axes)
    return figure


def varied(labels=("pod", "my_own_method"), outputs=("second_euler_angle", "spindle_y"), **grid):
    """Errors that a study of some methods could have over any dimensions."""
    names = [*grid, "label"]
    sizes = [len(values) for values in (*grid.values(), labels)]
    errors = 10.0 ** np.random.default_rng(3).uniform(-6.0, -2.0, (*sizes, len(outputs)))
    variables = {
        "rms_error": ((*names, "output"), errors),
        "signal_range": ((*names, "output"), np.ones_like(errors)),
        "status": (names, np.full(sizes, "ok", dtype=object)),
    }
    units = ["m" if output in ("lateral_position", "spindle_y") else "rad" for output in outputs]
    coordinates = {**grid, "label": list(labels), "output": list(outputs)}
    coordinates |= {"output_unit": ("output", units)}
    attributes = {"title": "what varies", "model": "double_wishbone", "configuration": "{}"}
    return xr.Dataset(variables, coordinates, attributes)
