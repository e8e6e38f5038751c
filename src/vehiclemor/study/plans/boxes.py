"""Boxes of scenarios, and drawing from them."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.maneuver import Maneuver
from vehiclemor.registry import choice, component
from vehiclemor.simulation.model import Model
from vehiclemor.study.plans.protocol_file import Box, Draw, ProtocolFile
from vehiclemor.study.scenario import Scenario, check, own_speed

# Decimals of drawn factors and speeds: what a table prints is what was run.
DECIMALS = 3
# Draws tried for each run before a box counts as too small.
TRIES = 100


def drawn(
    model: Model, draw: Draw, digest: str, purpose: str, known: Sequence[Scenario] = ()
) -> tuple[Scenario, ...]:
    """Scenarios of a draw, the same wherever the digest is the same.

    Parameters
    ----------
    known
        Runs that have been learned from or chosen by: they are not drawn, and none is twice.

    Raises
    ------
    InputError
        If the boxes hold too few different runs.
    """
    generator = np.random.default_rng(list(hashlib.sha256(f"{digest} {purpose}".encode()).digest()))
    shares = np.array([box.share for box in draw.boxes])
    seen, found = {scenario.run_key for scenario in known}, list[Scenario]()
    for _ in range(TRIES * draw.runs):
        box = draw.boxes[int(generator.choice(len(shares), p=shares / shares.sum()))]
        scenario = _one(model, box, generator)
        if scenario.run_key not in seen:
            seen.add(scenario.run_key)
            found.append(scenario)
        if len(found) == draw.runs:
            return tuple(found)
    raise InputError(f"{purpose}: the boxes hold fewer than {draw.runs} different runs")


def _one(model: Model, box: Box, generator: np.random.Generator) -> Scenario:
    """One point of a box."""

    def within(limits: Sequence[float]) -> float:
        return round(float(generator.uniform(limits[0], limits[1])), DECIMALS)

    frequency, amplitude = within(box.frequency), within(box.amplitude)
    if generator.random() < 0.5 and box.both_signs:
        amplitude = -amplitude
    speed = own_speed(model) if box.speed is None else within(box.speed)
    starts = box.start or [model.starts[0]]
    start = starts[int(generator.integers(len(starts)))]
    maneuver: Maneuver = component("maneuver", box.maneuver)
    return Scenario(maneuver.perturbed(frequency, amplitude), start, speed)


def check_boxes(model: Model, definition: ProtocolFile) -> None:
    """Raise `InputError` if a corner of a box is no scenario of the model."""
    for purpose in ("drawn", "drawn_outside"):
        draw: Draw | None = getattr(definition, purpose)
        for number, box in enumerate(draw.boxes if draw else (), start=1):
            try:
                _check_corners(model, box)
            except InputError as error:
                raise type(error)(f"{purpose}, box {number}: {error}") from None


def _check_corners(model: Model, box: Box) -> None:
    maneuver: Maneuver = component("maneuver", box.maneuver)
    for start in box.start:
        choice(f"start of {model.name}", start, model.starts)
    for frequency in box.frequency:
        for speed in box.speed or [None]:
            for amplitude in box.amplitude:
                corner = maneuver.perturbed(frequency, amplitude)
                check(model, Scenario(corner, (box.start or model.starts)[0], speed))
