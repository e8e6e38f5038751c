"""Results of the vehicles are unchanged: they agree with the committed references."""

import json

import numpy as np
import pytest

from tests.reference.vehicle_results import COUNTS, RUNS, current
from vehiclemor.resources import data_folder

# Step size control amplifies rounding: another processor may need a few steps more or less.
COUNT_TOLERANCE = 0.03


@pytest.fixture(scope="module", params=list(RUNS))
def name(request) -> str:
    return request.param


@pytest.fixture(scope="module")
def reference(name) -> dict:
    return json.loads((data_folder() / "reference" / f"{name}.json").read_text())


@pytest.fixture(scope="module")
def now(name) -> dict:
    return current(name)


def test_operation_counts_are_exact(reference, now):
    assert now["operations"] == reference["operations"]


def test_derivative_at_a_turning_state(reference, now):
    np.testing.assert_allclose(now["derivative"], reference["derivative"], rtol=1e-10, atol=1e-9)


def test_errors_floors_and_counts(reference, now):
    assert now["runs"].keys() == reference["runs"].keys()
    for run, expected in reference["runs"].items():
        found = now["runs"][run]
        for name in COUNTS:
            bound = COUNT_TOLERANCE * expected[name] + 2
            assert abs(found[name] - expected[name]) <= bound, (run, name)
        # Tolerances of the integrators: 1e-6, and that of the preset for the W-method.
        np.testing.assert_allclose(found["last"], expected["last"], rtol=0, atol=2e-3, err_msg=run)
        for kind in ("rms_error", "floor_rms_error"):
            np.testing.assert_allclose(
                found[kind], expected[kind], rtol=0.05, atol=1e-8, err_msg=f"{run}, {kind}"
            )
