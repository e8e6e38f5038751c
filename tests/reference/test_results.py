"""The double-wishbone results are unchanged: they agree with the committed reference."""

import json

import numpy as np
import pytest

from tests.reference.results import COUNTS, current
from vehiclemor.resources import data_folder

# Another processor rounds differently, and may need one iteration more or less here and there.
COUNT_TOLERANCE = 5


@pytest.fixture(scope="module")
def reference() -> dict:
    return json.loads((data_folder() / "reference" / "double_wishbone.json").read_text())


@pytest.fixture(scope="module")
def now() -> dict:
    return current()


def test_operation_counts_are_exact(reference, now):
    assert now["operations"] == reference["operations"]


def test_positions(reference, now):
    assert now["reach"] == pytest.approx(reference["reach"], abs=2e-6)
    for height, expected in reference["coordinates"].items():
        np.testing.assert_allclose(now["coordinates"][height], expected, atol=1e-11)


def test_errors_floors_and_counts(reference, now):
    assert now["runs"].keys() == reference["runs"].keys()
    for run, expected in reference["runs"].items():
        found = now["runs"][run]
        for name in COUNTS:
            assert abs(found[name] - expected[name]) <= COUNT_TOLERANCE, (run, name)
        for kind in ("rms_error", "floor_rms_error"):
            np.testing.assert_allclose(
                found[kind], expected[kind], rtol=1e-4, atol=1e-12, err_msg=f"{run}, {kind}"
            )
