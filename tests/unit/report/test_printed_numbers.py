"""Printed savings of time: what is beside them follows from the timing."""

import numpy as np
import pytest
import xarray as xr

from vehiclemor.report.printed_numbers import TIMING, time_saved
from vehiclemor.report.published import load_published

CAR = "high_fidelity_vehicle"


def timing():
    """Full order and POD: five times faster than it, four times slower than the fastest solver."""
    cases = ["baseline", "pod_r1"]
    outputs = ["lateral_speed", "vertical_speed"]
    by_case = {
        "seconds": [1.0, 0.2],
        "seconds_lower": [1.0, 0.2],
        "seconds_upper": [1.0, 0.2],
        "speed_up": [1.0, 5.0],
        "speed_up_strongest": [0.05, 0.25],
        "rhs_calls": [900, 300],
        "status": ["ok", "ok"],
    }
    variables = {name: ("case", values) for name, values in by_case.items()}
    variables["rms_error"] = ("case", "output"), np.full((2, 2), 1e-3)
    return xr.Dataset(variables, {"case": cases, "output": outputs})


def test_a_saving_stands_beside_the_time_of_the_fastest_solver():
    number = load_published().numbers["hfv_time_reduction"]
    finding = time_saved(number, {TIMING[CAR]: timing()}, "pod")
    assert finding.within
    assert (finding.reproduced, finding.strongest) == pytest.approx((0.8, 4.0))
    reason = "0.20 times the time of the same integrator, 300 evaluations against 900"
    assert finding.reason == f"{reason}; 4.00 times that of the best full-order solver"
