"""Fixtures of the tests of reduced vehicles."""

import pytest

from tests.reducing import CARS
from vehiclemor.reduction.methods import slow_manifold
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import validated
from vehiclemor.simulation.build import build


@pytest.fixture(scope="package", params=CARS)
def reduced(request):
    """Slow manifold of lane changes from both starts, without steps on whole runs."""
    model, maneuver = build(request.param), CARS[request.param]
    factors = (1.0, 1.0), (1.3, -0.7), (0.8, 1.2)
    runs = [TrainingRun(model, maneuver.perturbed(*f), s) for f in factors for s in model.starts]
    # Without these, six runs determine all terms of the high-fidelity vehicle but badly.
    given = {"steps": 0, "ridge": 1e-9}
    settings = validated(slow_manifold.METHOD, model.kind, given)
    return slow_manifold.fit(model, runs, settings)
