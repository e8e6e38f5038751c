"""Contract tests that every registered model and method must pass, plug-ins included.

Each function raises `AssertionError` with what is broken.  Call them from your tests.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from vehiclemor.exceptions import InputError
from vehiclemor.inputs.excitation import Excitation
from vehiclemor.multibody.definition import STATE_KINDS
from vehiclemor.reduction.interface import Method
from vehiclemor.reduction.training import TrainingRun
from vehiclemor.reduction.validation import checked_run, fitted, validated
from vehiclemor.registry import component
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.build import build, check_equations
from vehiclemor.simulation.model import Model
from vehiclemor.simulation.structures.model import StructuralModel, wrong_matrices
from vehiclemor.simulation.trajectory import FINISHED, Trajectory


def check_model(name: str) -> None:
    """A model has named quantities with units, and its nominal run can be simulated.

    A kinematic model closes its loops along that run, and its Jacobian is that of its residual; a
    dynamic model has finite derivatives; a structure has symmetric matrices of fitting sizes and
    stands, and the derivatives of its port forces are theirs.
    """
    model, definition = build(name), component("model", name)
    for kind in (*STATE_KINDS, "inputs", "outputs", "ports"):
        quantities = getattr(definition, kind)
        assert all(q.unit and q.long_name for q in quantities), f"{name}: unit or meaning missing"
    try:
        check_equations(definition, model.equations)
    except InputError as error:
        raise AssertionError(str(error)) from None
    assert model.evaluations in model.counts, f"{name}: {model.evaluations} is not counted"
    maneuver = component("maneuver", definition.maneuver)
    inputs = tuple(quantity.name for quantity in definition.inputs)
    assert maneuver.inputs == inputs, f"{name}: its maneuver gives other inputs"
    if isinstance(model, AlgebraicModel):
        _check_algebraic(model, maneuver)
    elif isinstance(model, StructuralModel):
        _check_structural(model, maneuver)
    else:
        _check_dynamic(model, maneuver)


def _check_algebraic(model: AlgebraicModel, maneuver: Excitation) -> None:
    name = model.name
    trajectory = _finite_run(model, maneuver)
    q, u = trajectory.coordinates[len(trajectory.times) // 3], trajectory.inputs[0]
    jacobian, step = model.jacobian(q, u), 1e-6
    # Residuals and their rounding errors are as large as the Jacobian.
    size = max(1.0, float(np.abs(jacobian).max()))
    largest = np.abs(model.values_at("residual", trajectory.coordinates, trajectory.inputs)).max()
    assert largest < 1e-10 * size, f"{name}: residual {largest:.1e} along the nominal run"
    differences = np.column_stack(
        [
            (model.residual(q + step * e, u) - model.residual(q - step * e, u)) / (2.0 * step)
            for e in np.eye(len(q))
        ]
    )
    error = np.abs(differences - jacobian).max()
    assert error < 1e-8 * size, f"{name}: the Jacobian differs from differences by {error:.1e}"


def _check_dynamic(model: Any, maneuver: Excitation) -> None:
    u = maneuver.at(maneuver.times)[0]
    for start in model.starts:
        derivative = model.rhs(model.start(start), u)
        assert np.isfinite(derivative).all(), f"{model.name}: derivative at {start!r} is not finite"
    _finite_run(model, maneuver)


def _finite_run(model: Model, maneuver: Excitation) -> Trajectory:
    run = model.simulate(maneuver)
    assert run.status == "ok", f"{model.name}: the nominal run is {run.status}"
    for history in (run.states, run.outputs):
        assert np.isfinite(history).all(), f"{model.name}: the nominal run is not finite"
    return run


def _check_structural(model: StructuralModel, maneuver: Excitation) -> None:
    name, structure = model.name, model.system.structure
    p, law = len(model.definition.ports), model.system.law
    wrong = wrong_matrices(structure, p, len(model.outputs))
    assert not wrong, f"{name}: {wrong}"
    assert np.isfinite(law.static).all(), f"{name}: its static state is not finite"
    u = _finite_run(model, maneuver).inputs[-1]
    # Near the static state, and where no force has a kink at rest.
    w, rates = 1e-3 * np.cos(np.arange(p)), 0.1 + 0.01 * np.arange(p)
    steps = {1: (1e-7, 0.0), 2: (0.0, 1e-7)}
    forces = law.at(w, rates, u)
    for column, (moved, quicker) in steps.items():
        for port in np.eye(p):
            ends = [law.at(w + s * moved * port, rates + s * quicker * port, u) for s in (1, -1)]
            difference = (ends[0][:, 0] - ends[1][:, 0]) / 2e-7
            error = np.abs(difference - forces[:, column] * port).max()
            bound = 1e-5 * max(1.0, np.abs(forces[:, column]).max())
            assert error < bound, f"{name}: a derivative of port forces is off by {error:.1e}"


def check_method(name: str, model_name: str) -> None:
    """A method declares its settings, and gives complete, repeatable trajectories.

    A model that the method does not accept must be refused with a reason.
    """
    method: Method = component("method", name)
    model = build(model_name)
    assert method.summary, f"{name}: no summary"
    accepted, reason = method.accepts(model)
    if not accepted:
        assert reason, f"{name}: refuses {model_name} without a reason"
        return
    for setting in method.settings[model.kind].model_fields.values():
        assert setting.description, f"{name}: a setting is not described"
    maneuver = component("maneuver", model.definition.maneuver)
    for preset in method.presets_of(model.kind):
        settings = validated(method, model.kind, {}, preset, len(model.coordinates))
        method.check(model, settings)
        for policy in ("matched", "nominal"):
            test = maneuver if policy == "matched" else maneuver.perturbed(1.1, 0.9)
            trained = TrainingRun(model, test if policy == "matched" else maneuver, model.starts[0])
            reduced = fitted(method, model, (trained,), settings)
            where = f"{name} ({preset}, {policy}) on {model_name}"
            try:
                first, again = (checked_run(model, test, model.starts[0], reduced) for _ in "12")
            except InputError as error:
                raise AssertionError(f"{where}: {error}") from None
            assert first.status in (*FINISHED, "diverged"), f"{where}: status {first.status!r}"
            if first.finished:
                for history in (first.states, first.outputs):
                    assert np.isfinite(history).all(), f"{where}: finished, but not finite"
            assert set(first.counts) == set(model.counts), f"{where}: counts are incomplete"
            histories = [np.hstack((run.states, run.outputs)) for run in (first, again)]
            same = np.array_equal(*histories, equal_nan=True)
            assert same, f"{where}: two runs differ"
            assert first.counts == again.counts, f"{where}: the counts of two runs differ"
            assert reduced.order >= 0, f"{where}: negative rank"
            assert reduced.offline.seconds >= 0.0, f"{where}: negative offline cost"
