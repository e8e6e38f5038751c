"""What is handed to compiled loops along a path is checked, for every model and every method."""

import numpy as np
import pytest

from tests.reducing import fitted
from vehiclemor.exceptions import InputError
from vehiclemor.registry import component
from vehiclemor.simulation.build import build

MODELS = ("double_wishbone", "independent_suspension_vehicle", "high_fidelity_vehicle")


@pytest.fixture(scope="module", params=MODELS)
def each_model(request):
    return build(request.param)


@pytest.mark.parametrize("function", ["outputs_at", "residual_at", "rhs_at"])
def test_paths_of_another_shape_or_not_finite_are_refused(each_model, function):
    call = getattr(each_model, function, None)
    if call is None:
        assert (function == "residual_at") == (each_model.kind != "ae")
        return
    n, m = len(each_model.definition.states), len(each_model.inputs)
    states, inputs = np.zeros((5, n)), np.zeros((5, m))
    bad = np.zeros((5, n))
    bad[3, 1] = np.nan
    wrong = [
        (np.zeros((1000, n)), inputs),
        (states, np.zeros((1, m))),
        (states[:, :3], inputs),
        (states, np.zeros((5, m + 1))),
        (states[0], inputs),
        (states[None], inputs),
        (states, None),
        ("abc", inputs),
        (bad, inputs),
        (states, np.full((5, m), np.inf)),
    ]
    for path in wrong:
        with pytest.raises(InputError, match=r"states|inputs"):
            call(*path)
    with pytest.raises(InputError, match=r"states\[3, 1\] is not finite"):
        call(bad, inputs)


@pytest.mark.parametrize(
    ("argument", "wrong", "named"),
    [
        *(
            ("times", times, "output times")
            for times in (
                [],
                [0.0, 2.0, 1.0],
                [0.0, 1e3],
                [-1.0, 0.0],
                [0.0, np.nan],
                [[0, 1]],
                1,
                "a",
            )
        ),
        *(
            ("start", start, "start")
            for start in (np.zeros(3), np.zeros((2, 8)), [np.nan] * 28, "abc", 1.0)
        ),
    ],
)
def test_times_and_starts_that_are_none_are_refused(each_model, argument, wrong, named):
    maneuver = component("maneuver", each_model.definition.maneuver)
    with pytest.raises(InputError, match=named):
        each_model.simulate(maneuver, **{argument: wrong})


def test_a_reduced_mechanism_that_diverges_tells_its_counts(model, nominal):
    reduced = fitted(model, nominal, "pod", rank=3)
    run = reduced.simulate(nominal.perturbed(amplitude=4.0), "equilibrium")
    assert run.status == "diverged"
    solved = int(np.isfinite(run.coordinates[:, 0]).sum())
    assert solved > 100
    assert run.counts["iterations"] >= solved + 50
    assert run.counts["jacobian_evaluations"] == run.counts["iterations"]
