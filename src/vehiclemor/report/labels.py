"""Words, symbols and short headings of outputs, for figures and printed tables."""

from typing import NamedTuple

import xarray as xr


class Label(NamedTuple):
    """How one output is called.

    Attributes
    ----------
    words
        In full.
    symbol
        As a formula for figures.
    short
        Heading of a narrow column.
    """

    words: str
    symbol: str
    short: str


LABELS = {
    "spindle_x": Label("spindle displacement", "x", "x"),
    "spindle_y": Label("spindle displacement", "y", "y"),
    "second_euler_angle": Label("second Euler angle", r"$\eta$", "angle"),
    "pitch": Label("pitch", r"$\theta$", "pitch"),
    "yaw": Label("yaw", r"$\psi$", "yaw"),
    "lateral_position": Label("lateral position", "Y", "Y"),
    "lateral_speed": Label("lateral speed", "$v_y$", "v_y"),
    "vertical_speed": Label("vertical speed", "$v_z$", "v_z"),
}


def label_of(output: str) -> Label:
    """The label of an output; of one that has no symbol its name in words."""
    words = output.replace("_", " ")
    return LABELS.get(output, Label(words, words, words))


def unit_of(dataset: xr.Dataset, output: str) -> str:
    """SI unit of an output."""
    return str(dataset["output_unit"].sel(output=output).item())


def axis_label(dataset: xr.Dataset, output: str) -> str:
    """Words, symbol and unit of an output."""
    label = label_of(output)
    symbol = "" if label.symbol == label.words else f" {label.symbol}"
    return f"{label.words}{symbol} ({unit_of(dataset, output)})"


def error_label(dataset: xr.Dataset, kind: str, output: str) -> str:
    """An error of an output, its symbol and unit, such as `RMS error`."""
    return f"{kind} of {label_of(output).symbol} ({unit_of(dataset, output)})"
