"""Time histories and their errors: figures 6, 7, 11, 12 and 14."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import matplotlib.pyplot as plt
import numpy as np

from vehiclemor.report.figures.lines import (
    DEFAULT,
    FULL,
    LITERAL,
    REPLAY,
    Results,
    legend_above,
    point,
)

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LABELS = {
    "spindle_y": "spindle displacement y (m)",
    "second_euler_angle": r"second Euler angle $\eta$ (rad)",
}


def _panels() -> tuple[Figure, list[Axes]]:
    figure, axes = plt.subplots(2, 1, sharex=True)
    for axis, letter, label in zip(axes, "ab", LABELS.values(), strict=True):
        axis.set_title(f"({letter})")
        axis.set_ylabel(label)
    axes[1].set_xlabel("time (s)")
    axes[1].set_xlim(0.0, 10.0)
    return figure, list(axes)


def _control_periods(axis: Axes) -> None:
    axis.axvline(5.0, color="#999999", linewidth=0.8, linestyle=(0, (1, 3)))


def _comparison(dataset: xr.Dataset, replay: bool) -> Figure:
    figure, axes = _panels()
    full = point(dataset, "full_order", rank=3)
    for axis, output in zip(axes, LABELS, strict=True):
        axis.plot(full.time, full["outputs"].sel(output=output), label="full order", **FULL)
        for label, text, style in (
            ("pod", "POD, r = 3 (least squares)", DEFAULT),
            ("pod_literal", "POD, r = 3 (literal)", LITERAL),
        ):
            reduced = point(dataset, label, rank=3)["outputs"].sel(output=output)
            axis.plot(full.time, reduced, label=text, **style)
        if replay:
            recorded = point(dataset, "replay", rank=3)["outputs"].sel(output=output)
            axis.plot(full.time, recorded, label="replay", **REPLAY)
        _control_periods(axis)
    legend_above(figure, axes[0])
    return figure


def figure_6(results: Results) -> Figure:
    """Nominal input, r = 3."""
    return _comparison(results["figures-6-7"], replay=False)


def figure_7(results: Results) -> Figure:
    """Errors of figure 6."""
    figure, axes = _panels()
    dataset = results["figures-6-7"]
    for axis, output in zip(axes, LABELS, strict=True):
        for label, text, style in (
            ("pod", "POD, r = 3 (least squares)", DEFAULT),
            ("pod_literal", "POD, r = 3 (literal: Galerkin)", LITERAL),
        ):
            reduced = point(dataset, label, rank=3)
            error = reduced["outputs"] - reduced["reference_outputs"]
            axis.plot(reduced.time, error.sel(output=output), label=text, **style)
        floor = float(point(dataset, "pod", rank=3)["floor_rms_error"].sel(output=output))
        axis.axhspan(
            -floor, floor, color="#BBBBBB", alpha=0.5, label="RMS of the best approximation"
        )
        _control_periods(axis)
    axes[0].set_ylabel("error of y (m)")
    axes[1].set_ylabel(r"error of $\eta$ (rad)")
    legend_above(figure, axes[0])
    return figure


def figure_11(results: Results) -> Figure:
    """Frequency +20 %."""
    return _comparison(results["figure-11"], replay=True)


def figure_12(results: Results) -> Figure:
    """Amplitude +20 %."""
    return _comparison(results["figure-12"], replay=True)


def figure_14(results: Results) -> Figure:
    """Frequency +100 %: r = 3 above, r = 6 with its spread and r = 4 below."""
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(6.7, 5.2))
    dataset, spread = results["figure-14"], results["figure-14-spread"]
    full = point(dataset, "full_order", rank=3)["outputs"].sel(output="second_euler_angle")
    for axis in axes:
        axis.plot(full.time, full, label="full order", **FULL)
        axis.set_ylabel(LABELS["second_euler_angle"])
        _control_periods(axis)
    replay = point(dataset, "replay", rank=3)["outputs"].sel(output="second_euler_angle")
    for label, text, style in (
        ("pod", "POD, r = 3 (least squares)", DEFAULT),
        ("pod_literal", "POD, r = 3 (literal)", LITERAL),
    ):
        reduced = point(dataset, label, rank=3)["outputs"].sel(output="second_euler_angle")
        axes[0].plot(full.time, reduced, label=text, **style)
    axes[0].plot(full.time, replay, label="replay", **REPLAY)
    six = point(spread, "pod_literal", rank=6)["outputs"].sel(output="second_euler_angle")
    six = six.transpose("rounding_seed", "time").values
    lowest, highest = np.nanmin(six, axis=0), np.nanmax(six, axis=0)
    span: dict[str, Any] = {"color": "#D55E00", "alpha": 0.3, "linewidth": 0.0}
    axes[1].fill_between(
        full.time, lowest, highest, label="POD, r = 6 (literal), spread (leaves the axes)", **span
    )
    uncut = point(spread, "pod_uncut", rank=6)["outputs"].sel(output="second_euler_angle")
    uncut = uncut.transpose("rounding_seed", "time").values
    axes[1].fill_between(
        full.time,
        np.nanmin(uncut, axis=0),
        np.nanmax(uncut, axis=0),
        label="POD, r = 6 (least squares), spread (thinner than a line)",
        color="#0072B2",
        alpha=0.6,
        linewidth=0.0,
    )
    axes[1].plot(full.time, six[0], label="POD, r = 6 (literal), as computed", **LITERAL)
    four = point(dataset, "pod", rank=4)["outputs"].sel(output="second_euler_angle")
    axes[1].plot(
        full.time, four, label="POD, r = 4 (least squares)", color="#009E73", linestyle="--"
    )
    low, high = float(full.min()), float(full.max())
    margin = 0.35 * (high - low)
    axes[1].set_ylim(low - margin, high + margin)
    axes[0].set_title("(a)")
    axes[1].set_title("(b)")
    axes[0].legend(loc="lower center", bbox_to_anchor=(0.53, 1.0), ncols=4)
    axes[1].legend(loc="lower center", bbox_to_anchor=(0.53, 1.0), ncols=2)
    axes[1].set_xlabel("time (s)")
    axes[1].set_xlim(0.0, 10.0)
    return figure
