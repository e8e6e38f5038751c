"""Structures: runs are those of other integrators and of textbook formulas; static states stand."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.sparse import csc_array
from scipy.sparse.linalg import spsolve

import vehiclemor as vm
from vehiclemor.exceptions import ConvergenceError, GeometryError, InputError
from vehiclemor.inputs.maneuver import Maneuver, smooth
from vehiclemor.simulation.structures.model import first_samples, relative_error

TRUCK = "flexible_truck"


def bump(size):
    """Heights (m) of the road that begin and end in a parabola."""
    return lambda t: size * np.sin(4.0 * np.pi * t) * np.sin(0.5 * np.pi * t) ** 2


def signal(size=0.02, duration=1.0):
    return vm.Signal.from_function(bump(size), duration, inputs=["z"], output_step=0.01)


def whole(signal, model):
    return signal.for_inputs(model.inputs)


def dense(model):
    """M, damping and stiffness of a chain, its ports and its law, written down anew."""
    s, p = model.system.structure, model.parameters.values()
    mass, stiffness, ports = (m.toarray() for m in (s.mass, s.stiffness, s.ports))
    damping = s.damping_time * stiffness + (s.dampers @ s.dampers.T).toarray()

    def law(w, rate, u):
        pressed = p["tire"] * (u[0] - w[1] + 1e-3 * (u[1] - rate[1]))
        spring = p["stiffness"] * w[0] + p["hardening"] * w[0] ** 3 + p["damping"] * rate[0]
        return np.array([-spring, max(pressed, 0.0)])

    return mass, damping, stiffness, ports, law, model.system.law.static


@pytest.fixture(scope="module")
def truck():
    return vm.model(TRUCK)


# The law of motion


def test_a_run_is_that_of_another_integrator_and_of_second_order(chain):
    # Also where the tire leaves the road, at times that are no multiples of a step.
    for size, tight in ((0.02, 3e-7), (0.1, 2e-4)):
        model, given = chain(masses=6.0), signal(size)
        mass, damping, stiffness, ports, law, (rest, held) = dense(model)
        complete, n = whole(given, model), model.size

        def rates(t, x, n=n, u=complete, parts=(mass, damping, stiffness, ports, law, rest, held)):
            mass, damping, stiffness, ports, law, rest, held = parts
            q, v = x[:n], x[n:]
            force = law(rest + ports.T @ q, ports.T @ v, u.at(np.array([t]))[0]) - held
            return np.r_[v, (ports @ force - stiffness @ q - damping @ v) / np.diag(mass)]

        how = {"rtol": 1e-8, "atol": 1e-11, "t_eval": complete.times}
        x = solve_ivp(rates, (0.0, 1.0), np.zeros(2 * n), "DOP853", **how).y
        slopes = [rates(t, s) for t, s in zip(complete.times, x.T, strict=True)]
        expected = np.column_stack([x[n - 1], x[-1], np.array(slopes)[:, -1]])
        errors = []
        for every in (20, 40, 320):
            found = first_samples(model.system, complete, every, 101)[0]
            errors.append(relative_error(found[:, :3], expected))
        assert errors[-1] < tight
        if size < 0.1:
            # Heights, speeds and accelerations alike.
            assert 3.8 < errors[0] / errors[1] < 4.2
        else:
            remark = model.run(given).remark
            lifted = 0.01 * np.flatnonzero(found[:, 3] == 0.0)[0]
            assert remark == f"off the ground for a time: A (first at {lifted:.4g} s)"


# Matrices


def test_a_static_state_is_that_of_a_direct_solution(chain, truck):
    for model in (chain(), truck):
        s, (w, force) = model.system.structure, model.system.law.static
        # Springs of 1 kN/m, taken off again, hold what the structure itself does not.
        held = csc_array(s.stiffness + 1e3 * s.ports @ s.ports.T)
        q = spsolve(held, s.load + s.ports @ (force + 1e3 * w))
        np.testing.assert_allclose(s.ports.T @ q, w, rtol=0, atol=1e-8)
        still = model.system.law.at(0.0 * w, 0.0 * w, np.zeros(len(model.inputs)))
        assert np.abs(still[:, 0]).max() < 1e-9
    p, (w, force) = chain().parameters.values(), chain().system.law.static
    # A chain of 981 N on two springs, that on top of the tire stretched by what it carries.
    assert force.sum() == pytest.approx(981.0, rel=1e-9)
    assert w[1] == pytest.approx(-force[1] / p["tire"], rel=1e-9)
    own = p["stiffness"] * -w[0] + p["hardening"] * -(w[0] ** 3)
    assert own == pytest.approx(force[0], rel=1e-9)
    loads = truck.system.law.static[1, 8:]
    p = truck.parameters.values()
    masses = ("sprung_mass", "front_axle_mass", "rear_axle_mass", "payload")
    weight = p["gravity"] * sum(p[name] for name in masses)
    assert loads.sum() == pytest.approx(weight, rel=1e-9)
    with pytest.raises(GeometryError, match="standing_chain finds no static state"):
        chain(stiffness=-1.0, hardening=0.0, tire=-1.0, chain=1e9).run(signal())


# Runs


def test_the_step_that_is_chosen_meets_the_tolerance(chain):
    def late(t):
        return np.where((t > 1.0) & (t < 1.1), 0.05 * np.sin(10.0 * np.pi * t) ** 2, 0.0)

    sharp = vm.Signal.from_function(late, 2.0, inputs=["z"], output_step=0.01)
    for given in (signal(), sharp):
        model, steps = chain(), []
        complete = whole(given, model)
        exact = first_samples(model.system, complete, 320, complete.samples)[0]
        for tolerance in (1e-2, 1e-3, 1e-4):
            run = model.simulate(given, tolerance=tolerance)
            assert relative_error(run.outputs, exact) < tolerance
            steps.append(run.counts["steps"])
        assert steps == sorted(steps)
        assert steps[-1] >= 2 * steps[0]


def test_what_diverges_is_a_recorded_result(chain):
    # A spring that softens.
    model = chain(hardening=-3e6)
    run = model.run(signal(0.1, 2.0))
    assert (run.status, run.finished) == ("diverged", False)
    value, words = run.message.split(" at ", 1)
    assert words == "t = 0.91 s; the model holds from -0.2 to 0.2"
    assert float(value.removeprefix("top is ")) < -0.2
    np.testing.assert_array_equal(np.isfinite(run.outputs).all(axis=1), run.times < 0.905)
    with pytest.raises(ConvergenceError, match="standing_chain: top is") as error:
        model.simulate(signal(0.1, 2.0), tolerance=3e-3)
    np.testing.assert_array_equal(error.value.trajectory.outputs, run.outputs)
    run = chain(hardening=-2e7).run(signal(0.1, 2.0))
    assert run.status == "diverged"
    assert run.message == "no convergence of the port forces at t = 0.42 s"
    np.testing.assert_array_equal(np.isfinite(run.outputs).all(axis=1), run.times < 0.415)


def nothing(times, *_):
    return np.full((len(times), 2), np.nan)


NOWHERE = Maneuver("nowhere", "", nothing, ("z", "z_dot"), 1.0, 101, smooth)
WRONG = [
    ({"maneuver": "lane_change"}, "delta"),
    ({"maneuver": signal(0.4)}, "z is .* holds from -0.3 to 0.3"),
    ({"maneuver": NOWHERE}, "input z is not finite at t = 0 s"),
    ({"start": "dropped"}, "unknown start 'dropped'; known: equilibrium"),
    ({"solver": "dopri5"}, "solver 'dopri5'"),
    ({"tolerance": np.nan}, "tolerance"),
    ({"outputs": ["bottom"]}, "bottom"),
    ({"times": [0.005]}, "0.005 s is no output time"),
]


@pytest.mark.parametrize(("wrong", "words"), WRONG)
def test_wrong_input_is_told_in_one_line(chain, wrong, words):
    given = {"maneuver": signal()} | wrong
    if isinstance(given["maneuver"], str):
        given["maneuver"] = vm.maneuver(given["maneuver"])
    with pytest.raises(InputError, match=words):
        chain().simulate(**given)


def test_a_tolerance_that_no_step_meets_is_told(chain):
    assert "of an output's range" in chain().run(signal(), tolerance=1e-12).remark
    assert chain().run(signal(), tolerance=1e-2).remark == ""
