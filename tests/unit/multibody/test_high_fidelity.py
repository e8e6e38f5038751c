"""The high-fidelity vehicle stands at its design position, whatever its parameters; its pivots."""

from collections.abc import Mapping
from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vehiclemor.exceptions import GeometryError
from vehiclemor.multibody.high_fidelity.definition import check
from vehiclemor.multibody.quantities import WHEELS
from vehiclemor.simulation.build import build
from vehiclemor.simulation.dynamic import DynamicModel

NAME = "high_fidelity_vehicle"
N = 26
REST = np.zeros(3)
# Bodies of the front axle and of the rear one, with the number of each; centres in front are given
# in the front's frame, behind from the rear left wheel's centre.
FRONT = ("upper_arm", "lower_arm", "carrier")


def built(**overrides: object) -> DynamicModel:
    return build(NAME, overrides=overrides)


@pytest.fixture(scope="module")
def given_values() -> dict[str, np.ndarray]:
    return built().parameters.values()


def statics(p: Mapping[str, np.ndarray], pitch: float = 0.0) -> tuple[float, float]:
    """Mass, and the share of the weight on the front axle by the moments about the rear wheels."""
    front, rear = p["front_frame_origin"], p["rear_wheel_centre"]
    middle_of_rod = (p["tie_rod_inner"] + p["tie_rod_outer"]) / 2
    bodies = [(p["chassis_mass"], p["chassis_centre"])]
    bodies += [(2 * p[f"{name}_mass"], front + p[f"{name}_centre"]) for name in FRONT]
    bodies += [(2 * p["tie_rod_mass"], front + middle_of_rod)]
    bodies += [(2 * p["front_wheel_mass"], front + p["wheel_centre"])]
    bodies += [(2 * p["rear_arm_mass"], rear + p["rear_arm_centre"])]
    bodies += [(2 * p["rear_wheel_mass"], rear)]
    mass = sum(float(part) for part, _ in bodies)
    # Along the road; a wheel without camber stands below its centre.
    along = np.array([np.cos(pitch), 0.0, np.sin(pitch)])
    moment = sum(float(part) * float((place - rear) @ along) for part, place in bodies)
    return mass, moment / mass / float((front + p["wheel_centre"] - rear) @ along)


def outputs(model: DynamicModel, x: np.ndarray) -> dict[str, float]:
    return dict(zip(model.outputs, model.outputs_at(x[None], REST[None])[0], strict=True))


CHANGED = {
    "gravity": 2.0,
    "chassis_mass": 1.6,
    "carrier_mass": 3.0,
    "front_wheel_mass": 2.0,
    "rear_arm_mass": 2.0,
    "rear_wheel_mass": 2.0,
    "tire_stiffness": 2.0,
    "tire_radius": 1.2,
    "front_stiffness": 4.0,
    "rear_stiffness": 4.0,
    "front_damping": 5.0,
    "initial_speed": 2.0,
}
FACTORS = {name: st.floats(1.0 / spread, spread) for name, spread in CHANGED.items()}


@settings(max_examples=6, derandomize=True)
@given(
    factors=st.fixed_dictionaries(FACTORS), shift=st.floats(-0.4, 0.4), height=st.floats(-0.1, 0.3)
)
def test_the_design_position_is_at_rest_for_any_vehicle(given_values, factors, shift, height):
    changed = {name: factor * given_values[name] for name, factor in factors.items()}
    centre = given_values["chassis_centre"] + [shift, 0.0, height]
    model = built(chassis_centre=centre, **changed)
    p = model.parameters.values()
    x = model.start()
    # Rounding of forces of some 1e4 N, which move parts of 1 kg.
    assert np.abs(model.rhs(x, REST)[N:]).max() < 1e-9 * max(1.0, float(p["gravity"]))
    # Joints as they were designed, no roll, no heading; the corners are closed.
    design = built().start()[:N]
    np.testing.assert_array_equal(np.delete(x[:N] - design, [2, 4]), 0.0)
    assert np.abs(model.violations(x, REST)[0]).max() < 1e-14
    found = outputs(model, x)
    loads = np.array([found[f"Fz_{wheel}"] for wheel in WHEELS])
    mass, share = statics(p, x[4])
    weight = mass * p["gravity"]
    assert loads.sum() == pytest.approx(weight, rel=1e-12)
    assert loads[:2].sum() == pytest.approx(share * weight, rel=1e-11)
    np.testing.assert_allclose(loads[::2], loads[1::2], rtol=1e-12)
    # Tires are pressed by their loads: heights of the wheel centres by plain geometry.
    radii = p["tire_radius"] - loads / p["tire_stiffness"]
    up = np.array([-np.sin(x[4]), 0.0, np.cos(x[4])])
    front = p["front_frame_origin"] + p["wheel_centre"] - centre
    for k, place in ((0, front), (2, p["rear_wheel_centre"] - centre)):
        assert x[2] + up @ place == pytest.approx(radii[k], abs=1e-13)
    # Wheels roll without slip.
    np.testing.assert_allclose(x[48:] * radii, p["initial_speed"], rtol=1e-12)
    assert x[N] == p["initial_speed"]
    assert max(abs(found[f"slip_ratio_{wheel}"]) for wheel in WHEELS) < 1e-14


# Vehicles that can't stand


# What is wrong -> overrides by the vehicle's own values, and a word of the message.
IMPOSSIBLE = {
    "front tires pressed flat": (lambda _: {"tire_stiffness": 11e3}, "front tires"),
    "front spring without length": (
        lambda p: {"front_spring_chassis_point": p["front_spring_arm_point"]},
        "front spring",
    ),
    # As all that a linkage of its kind refuses.
    "tie rod without length": (lambda p: {"tie_rod_inner": p["tie_rod_outer"]}, "tie rod"),
    "front wheels behind the rear ones": (
        lambda p: {"rear_wheel_centre": p["front_frame_origin"] + [0.1, 0.7, 0.0]},
        "front wheels",
    ),
    "spring that pushes along its arm": (
        # In line with the arm's pivot axis: no free length turns the arm.
        lambda p: {
            "rear_spring_arm_point": p["rear_arm_pivot"] + [-0.2, 0.0, 0.0],
            "rear_spring_chassis_point": p["rear_arm_pivot"] + [-0.4, 0.0, 0.0],
        },
        "free lengths",
    ),
    "centre beside the midplane": (
        lambda _: {"chassis_centre": [0.0, 0.3, 0.2277]},
        "chassis_centre",
    ),
    "left wheel on the right": (lambda _: {"rear_wheel_centre": [-1.388, -0.8, 0]}, "rear wheel"),
    "a chassis that no mass has": (
        lambda _: {"chassis_inertia": [1.0, 1.0, 1e3]},
        "chassis_inertia",
    ),
    "friction that rises": (
        lambda _: {"largest_friction": 0.2, "smallest_friction": 0.9},
        "friction",
    ),
}


@pytest.mark.parametrize(("change", "words"), IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_a_vehicle_that_cant_be_or_cant_stand_is_refused(given_values, change, words):
    with pytest.raises(GeometryError, match=words):
        built(**change(given_values))


def test_limits_are_where_statics_puts_them(given_values):
    """The centre of mass between the axles, and tires that carry the vehicle."""
    p, (mass, share) = given_values, statics(given_values)
    wheelbase = (p["front_frame_origin"] + p["wheel_centre"] - p["rear_wheel_centre"])[0]
    for place, end in ((1.0 - share, "rear"), (-share, "front")):
        for beyond, refused in ((1e-9, True), (-1e-9, False), (-0.05, False)):
            shift = place * wheelbase * mass / float(p["chassis_mass"]) + np.sign(place) * beyond
            shifted = p | {"chassis_centre": p["chassis_centre"] + [shift, 0.0, 0.0]}
            with pytest.raises(GeometryError, match=end) if refused else nullcontext():
                check(shifted)
        # It also stands there, as far as its tires carry it.
        assert np.isfinite(built(chassis_centre=shifted["chassis_centre"]).start()).all()
    softest = max(share, 1.0 - share) * mass * p["gravity"] / 2.0 / p["tire_radius"]
    check(p | {"tire_stiffness": softest * (1.0 + 1e-12)})
    with pytest.raises(GeometryError, match="rear tires"):
        check(p | {"tire_stiffness": softest * (1.0 - 1e-12)})
