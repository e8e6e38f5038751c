"""The high-fidelity vehicle stands still at its design position, whatever its parameters."""

from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vehiclemor.errors import GeometryError
from vehiclemor.multibody.high_fidelity.equilibrium import check
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


def factor(spread: float) -> st.SearchStrategy[float]:
    return st.floats(1.0 / spread, spread)


def scaled(names: Mapping[str, float]) -> st.SearchStrategy[dict[str, float]]:
    """Factors of parameters."""
    return st.fixed_dictionaries({name: factor(spread) for name, spread in names.items()})


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


@settings(max_examples=6, derandomize=True)
@given(factors=scaled(CHANGED), shift=st.floats(-0.4, 0.4), height=st.floats(-0.1, 0.3))
def test_the_design_position_is_at_rest_for_any_vehicle(given_values, factors, shift, height):
    changed = {name: factor * given_values[name] for name, factor in factors.items()}
    centre = given_values["chassis_centre"] + [shift, 0.0, height]
    model = built(chassis_centre=centre, **changed)
    p = model.parameters.values()
    x = model.start()
    # Rounding of forces of some 1e4 N, which move parts of 1 kg.
    assert np.abs(model.derivative(x, REST)[N:]).max() < 1e-9 * max(1.0, float(p["gravity"]))
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


def test_the_equilibrium_is_where_the_vehicle_comes_to_rest():
    """Not only at rest: pushed out of it, weight and springs bring it back."""
    model = built()
    x = model.start()
    for place, push in ((2, 1e-4), (4, 1e-4), (20, 1e-4), (21, 1e-4)):
        for sign in (1.0, -1.0):
            pushed = x.copy()
            pushed[place] += sign * push
            assert sign * model.derivative(pushed, REST)[N + place] < 0.0


@pytest.mark.parametrize(("end", "arm"), [("front", 10), ("rear", 20)])
def test_a_stiffer_spring_has_the_same_preload(given_values, end, arm):
    """Statics alone sets what it carries; beyond that it resists in proportion to its stiffness."""
    stands, bent = [], []
    for factor in (0.5, 1.0, 2.0):
        model = built(**{f"{end}_stiffness": factor * float(given_values[f"{end}_stiffness"])})
        x = model.start()
        stands.append(model.descriptor(x, REST)[1])
        x[arm] += 0.05
        bent.append(model.descriptor(x, REST)[1][arm])
    for force in stands[1:]:
        np.testing.assert_allclose(force, stands[0], rtol=0, atol=1e-9 * np.abs(stands[0]).max())
    assert bent[2] - bent[1] == pytest.approx(2.0 * (bent[1] - bent[0]), rel=1e-9)
    assert bent[2] < bent[1] - 100.0


def test_the_dropped_start_is_lifted_and_pitched(given_values):
    model = built(drop_height=0.2, drop_pitch=0.0)
    lifted, stands = model.initial["dropped"], model.initial["equilibrium"]
    assert np.flatnonzero(lifted - stands).tolist() == [2]
    assert lifted[2] - stands[2] == pytest.approx(0.2)
    # All wheels are in the air: the centre of mass falls freely, and no wheel is loaded.
    found = outputs(model, lifted)
    assert [found[f"Fz_{wheel}"] for wheel in WHEELS] == [0.0] * 4
    mass, force, by_q, gamma = model.descriptor(lifted, REST)
    system = np.block([[mass, -by_q.T], [by_q, np.zeros((12, 12))]])
    accelerations = np.linalg.solve(system, [*force, *gamma])[:N]
    weight = statics(given_values)[0] * given_values["gravity"]
    assert mass[2] @ accelerations == pytest.approx(-weight, rel=1e-12)


# Vehicles that can't stand


def at_another_place(**places: str):
    return lambda p: {name: p[place] for name, place in places.items()}


def fixed(**values: object):
    return lambda _: values


IMPOSSIBLE = {
    "front tires pressed flat": (fixed(tire_stiffness=11e3), "front tires"),
    "front spring without length": (
        at_another_place(front_spring_chassis_point="front_spring_arm_point"),
        "front spring",
    ),
    "rear spring without length": (
        at_another_place(rear_spring_arm_point="rear_spring_chassis_point"),
        "rear spring",
    ),
    # As all that a linkage of its kind refuses.
    "tie rod without length": (at_another_place(tie_rod_inner="tie_rod_outer"), "tie rod"),
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
    "springs without stiffness": (fixed(front_stiffness=1e-30), "free lengths"),
    "centre beside the midplane": (fixed(chassis_centre=[0.0, 0.3, 0.2277]), "chassis_centre"),
    "front beside the midplane": (fixed(front_frame_origin=[1.388, -0.1, 0.1]), "front_frame"),
    "left wheel on the right": (fixed(rear_wheel_centre=[-1.388, -0.8, 0.0]), "rear wheel"),
    "a chassis that no mass has": (fixed(chassis_inertia=[1.0, 1.0, 1e3]), "chassis_inertia"),
    "an arm that no mass has": (fixed(rear_arm_inertia_products=[10.0] * 3), "rear_arm_inertia"),
    "friction that rises": (fixed(largest_friction=0.2, smallest_friction=0.9), "friction"),
}


@pytest.mark.parametrize(("change", "words"), IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_a_vehicle_that_cant_be_or_cant_stand_is_refused(given_values, change, words):
    with pytest.raises(GeometryError, match=words):
        built(**change(given_values))


@pytest.mark.parametrize("ahead", [True, False])
def test_the_centre_of_mass_must_be_between_the_axles(given_values, ahead):
    """On either side of where statics puts the limit."""
    p = given_values
    mass, share = statics(p)
    wheelbase = (p["front_frame_origin"] + p["wheel_centre"] - p["rear_wheel_centre"])[0]
    limit = (1.0 - share if ahead else -share) * wheelbase * mass / float(p["chassis_mass"])
    direction = 1.0 if ahead else -1.0

    def shifted(beyond: float) -> dict[str, np.ndarray]:
        centre = p["chassis_centre"] + [limit + direction * beyond, 0.0, 0.0]
        return p | {"chassis_centre": centre}

    check(shifted(-1e-9))
    with pytest.raises(GeometryError, match=f"lifts the {'rear' if ahead else 'front'} wheels"):
        check(shifted(1e-9))
    # It also stands there, as far as its tires carry it.
    x = built(chassis_centre=shifted(-0.05)["chassis_centre"]).start()
    assert np.isfinite(x).all()


def test_the_softest_tires_that_carry_the_vehicle(given_values):
    mass, share = statics(given_values)
    heavier = max(share, 1.0 - share)
    softest = heavier * mass * given_values["gravity"] / 2.0 / given_values["tire_radius"]
    check(given_values | {"tire_stiffness": softest * (1.0 + 1e-12)})
    with pytest.raises(GeometryError, match="presses the rear tires flat"):
        check(given_values | {"tire_stiffness": softest * (1.0 - 1e-12)})
