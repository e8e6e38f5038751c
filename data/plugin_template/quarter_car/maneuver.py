"""The maneuver that the model is driven by if none is named: a wavy road."""

import numpy as np

from vehiclemor.plugin import Maneuver


def sine(times, frequency, amplitude):
    """Heights of the road in m, (times, 1): a column for each input of the model.

    Studies scale a maneuver by factors on its frequency and amplitude, 1 where it is nominal.
    """
    return 0.02 * amplitude * np.sin(2.0 * np.pi * 1.5 * frequency * times)[:, None]


ROAD = Maneuver(
    name="quarter_car_road",
    summary="road of 0.02 m x sin(2 pi 1.5 Hz t)",
    signal=sine,
    inputs=("road",),
    duration=5.0,
    samples=501,
    # Times in s at which the signal has a kink or a jump: integrators stop and start there.
    corners=lambda frequency: (),
)
