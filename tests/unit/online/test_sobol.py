"""Sobol indices: of a small box they are those of the gradient, and what is refused."""

import numpy as np
import pytest

import vehiclemor as vm
from vehiclemor.errors import InputError

WISHBONE = "double_wishbone"
POINTS = ("tie_rod_inner.z", "upper_ball_joint.z")
SMALL = 2e-4


@pytest.fixture(scope="module")
def travel():
    t = np.linspace(0.0, 1.0, 31)
    return vm.Signal.from_samples(t, 0.05 * np.sin(2.0 * np.pi * t), inputs=["z"])


@pytest.fixture(scope="module")
def box():
    model = vm.model(WISHBONE)
    heights = [float(model.parameters[name.removesuffix(".z")][2]) for name in POINTS]
    return {
        name: (z - SMALL, z + k * SMALL) for name, z, k in zip(POINTS, heights, (1, 3), strict=True)
    }


def test_indices_of_a_small_box_are_those_of_the_gradient(travel, box):
    objectives = ["bump_steer", "camber_gain"]
    found = vm.sobol_indices(WISHBONE, objectives, box, maneuver=travel, samples=64, jobs=1)
    moved = vm.sensitivities(WISHBONE, travel, parameters=list(POINTS))
    widths = np.array([high - low for low, high in box.values()])
    for name in objectives:
        shares = (vm.objective(name).gradient(moved).values * widths) ** 2 / 12.0
        own = found.sel(objective=name)
        spread = float(own["standard_deviation"])
        assert spread == pytest.approx(np.sqrt(shares.sum()), rel=0.1)
        for order in ("first_order", "total_order"):
            np.testing.assert_allclose(own[order], shares / shares.sum(), atol=0.05)
            assert (own[f"{order}_low"] <= own[order] + 1e-12).all()
            assert (own[order] <= own[f"{order}_high"] + 1e-12).all()
    assert found.attrs["runs"] == 64 * (len(POINTS) + 2)
    again = vm.sobol_indices(WISHBONE, objectives, box, maneuver=travel, samples=64, jobs=2)
    np.testing.assert_array_equal(again["total_order"], found["total_order"])


def test_what_has_no_effect_has_the_index_zero_and_no_warning(recwarn):
    ends = ("", "_low", "_high")
    orders = [f"{order}_order{end}" for order in ("first", "total") for end in ends]

    def indices(**box):
        found = vm.sobol_indices(
            "independent_suspension_vehicle", "peak_roll", box, samples=8, jobs=1
        )
        return found.isel(objective=0)

    # It stands at rest, wherever it would drop from.
    found = indices(drop_height=[0.005, 0.01], sprung_mass=[900.0, 1000.0])
    assert [float(found[name][0]) for name in orders] == [0.0] * 6
    assert float(found["total_order_low"][1]) > 0.0
    found = indices(drop_height=[0.005, 0.01], drop_pitch=[0.001, 0.002])
    assert float(found["standard_deviation"]) < 1e-12
    assert all(np.isnan(found[name]).all() for name in orders)
    assert not recwarn.list


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"samples": 48}, "not a power of two"),
        ({"box": {}}, "box is {}"),
        ({"box": {POINTS[0]: 3.0}}, "not the two ends of a range"),
        ({"box": {POINTS[0]: (0.2, 0.1)}}, "not the two ends of a range"),
        ({"box": {"tie_rod.z": (0.1, 0.2), POINTS[0]: (0.1, 0.2)}}, "is not a parameter"),
        ({"box": {POINTS[0]: (0.1, 0.2)}}, "tie_rod_inner.z alone"),
        ({"box": {POINTS[0]: (0.1, 0.9), POINTS[1]: (0.1, 0.2)}}, "cars in the box fail"),
        ({"objectives": []}, "objectives is []"),
        ({"objectives": "roll"}, "unknown objective"),
        ({"objectives": "peak_roll"}, "peak_roll needs roll"),
        ({"maneuver": "step_steer"}, "gives inputs"),
    ],
)
def test_wrong_input_is_one_line(travel, box, changes, line):
    given = {"objectives": "bump_steer", "box": box, "maneuver": travel, "samples": 4} | changes
    with pytest.raises(InputError) as error:
        vm.sobol_indices(WISHBONE, **given)
    assert line in str(error.value)
    assert "\n" not in str(error.value)
