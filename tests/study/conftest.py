"""A small protocol of the suspension, for tests of the schema and of the runner."""

import pytest

SMALL = """
title = "for the tests"
model = "double_wishbone"
reported = ["toe"]
bounds.spindle_y = { measure = "rms", bound = 7.57e-5 }
bounds.second_euler_angle = { measure = "max", bound = 2.4e-5 }
training = [{ maneuver = "sine_travel", points = [[1.0, 1.2]] }]
validation = [{ maneuver = "sine_travel", frequency = [1.3], amplitude = [1.0, -1.1] }]
targets = [{ against = "within bounds", ratio = 2.0 }, { against = "newton 1e-12", ratio = 10.0 }]

[[test]]
maneuver = "sine_travel"
points = [[0.9, 1.0]]

[[test]]
maneuver = "chirp_travel"

[drawn]
runs = 5
boxes = [{ maneuver = "sine_travel", frequency = [0.7, 2.0], amplitude = [0.5, 1.1] }]

[drawn_outside]
runs = 2
boxes = [{ maneuver = "sine_travel", frequency = [0.7, 2.0], amplitude = [1.3, 1.4] }]

[[methods]]
label = "newton"
method = "full_order"
role = "full order"
candidates = [{ tolerance = 1e-12 }, { tolerance = 1e-6 }]

[[methods]]
label = "replay"
method = "replay"
role = "baseline"

[[methods]]
label = "fixed basis"
method = "fixed_basis"
candidates = [{ rank = 1 }, { rank = 3 }, { rank = 4 }]
"""


@pytest.fixture(scope="session")
def protocol_text() -> str:
    """Text of the small protocol; its outside set is empty."""
    return SMALL
