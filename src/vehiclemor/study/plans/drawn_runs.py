"""Test runs of a protocol, drawn from boxes of scenarios.

They follow from the protocol file alone: its seed, its version and its boxes.  Every machine and
every commit gets the same runs, whatever methods compete on them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from vehiclemor.errors import InputError
from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.registry import component
from vehiclemor.simulation.model import Model
from vehiclemor.study.plans.protocol import Protocol
from vehiclemor.study.plans.study_file import DRAWN, Box, Draw
from vehiclemor.study.scenario import Scenario, own_speed

# Decimals of drawn factors and speeds: what a table prints is what was run.
DECIMALS = 3
# Draws tried for each run before a box counts as too small.
TRIES = 100
# Sets that models have learned from or were chosen by.
LEARNED = ("training", "validation")


def drawn_sets(protocol: Protocol) -> dict[str, tuple[Scenario, ...]]:
    """Drawn sets of a protocol by name; none of their runs is one of training or validation.

    Raises
    ------
    InputError
        If the boxes hold too few different runs.
    """
    # What is listed for other ends may be drawn again: else a list could strike runs from a draw.
    known = [scenario for name in LEARNED for scenario in protocol.sets[name]]
    found: dict[str, tuple[Scenario, ...]] = {}
    for number, name in enumerate(DRAWN):
        draw = getattr(protocol.definition, name)
        if draw is not None:
            seeds = protocol.seed, protocol.definition.version, number
            found[name] = drawn(protocol.model, draw, seeds, known)
            known += found[name]
    return found


def drawn(
    model: Model, draw: Draw, seeds: Sequence[int], known: Sequence[Scenario] = ()
) -> tuple[Scenario, ...]:
    """Different scenarios of a draw, none of them known; the same wherever the seeds are the same.

    Raises
    ------
    InputError
        If the boxes hold too few different runs.
    """
    # Of the generator only `random` is used: NumPy may change how the other functions draw.
    generator = np.random.Generator(np.random.PCG64(seeds))
    shares = np.cumsum([box.share for box in draw.boxes])
    seen, found = {scenario.run_key for scenario in known}, list[Scenario]()
    for _ in range(TRIES * draw.runs):
        place = generator.random() * shares[-1]
        box = draw.boxes[int(np.searchsorted(shares, place, side="right"))]
        scenario = _one(model, box, generator)
        if scenario.run_key not in seen:
            seen.add(scenario.run_key)
            found.append(scenario)
        if len(found) == draw.runs:
            return tuple(found)
    raise InputError(f"the boxes hold fewer than {draw.runs} different runs")


def _one(model: Model, box: Box, generator: np.random.Generator) -> Scenario:
    """One point of a box."""

    def within(limits: Sequence[float]) -> float:
        low, high = limits
        return round(low + (high - low) * generator.random(), DECIMALS)

    frequency, amplitude = within(box.frequency), within(box.amplitude)
    if generator.random() < 0.5 and box.both_signs:
        amplitude = -amplitude
    speed = own_speed(model) if box.speed is None else within(box.speed)
    starts = box.start or model.starts[:1]
    start = starts[int(generator.random() * len(starts))]
    maneuver: Maneuver = component("maneuver", box.maneuver)
    return Scenario(maneuver.perturbed(frequency, amplitude), start, speed)
