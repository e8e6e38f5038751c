"""Exudyn: the double wishbone of rigid bodies and joints, and the truck from its matrices."""

from typing import Any

import exudyn as exu
import exudyn.itemInterface
import numpy as np
from clock import Case, Curve, decades
from exudyn.rigidBodyUtilities import RigidBodyInertia
from scipy.sparse import csr_matrix, diags_array


def wishbone(mbs: Any, points: dict[str, np.ndarray], travel: Any) -> int:
    """Arms, a tie rod and the carrier between them, whose number is returned, by its travel."""
    place = points["wheel_centre"].tolist()
    body = {"inertia": RigidBodyInertia(1.0, np.eye(3)), "referencePosition": place}
    body["nodeType"] = exu.NodeType.RotationRxyz
    ground = mbs.CreateGround()
    *arms, carrier = (mbs.CreateRigidBody(**body) for _ in range(3))
    for name, arm in zip(("upper", "lower"), arms, strict=True):
        rear, front = (points[f"{name}_arm_{end}_pivot"] for end in ("rear", "front"))
        ball = points[f"{name}_ball_joint"]
        mbs.CreateRevoluteJoint(bodyNumbers=[ground, arm], position=rear, axis=front - rear)
        mbs.CreateSphericalJoint(bodyNumbers=[arm, carrier], position=ball)
    inner, outer = points["tie_rod_inner"], points["tie_rod_outer"]
    ends = {"localPosition0": inner, "localPosition1": outer - points["wheel_centre"]}
    length = float(np.linalg.norm(outer - inner))
    mbs.CreateDistanceConstraint(bodyNumbers=[ground, carrier], distance=length, **ends)
    fixed = mbs.AddMarker(exu.itemInterface.MarkerBodyRigid(bodyNumber=ground, localPosition=place))
    wheel = mbs.AddMarker(exu.itemInterface.MarkerBodyRigid(bodyNumber=carrier))
    axes = {"constrainedAxes": [0, 0, 1, 0, 0, 0], "offsetUserFunction": travel}
    mbs.AddObject(exu.itemInterface.ObjectJointGeneric(markerNumbers=[fixed, wheel], **axes))
    return carrier


def mechanism(case: Case) -> dict[str, Curve]:
    """Newton's method for all constraints at each sample: as many as there are coordinates."""
    points = {k: np.array(v) for k, v in case.model.parameters.values().items()}
    heights, last = case.maneuver.at(case.maneuver.times)[:, 0], len(case.maneuver.times) - 1
    kinds = exu.OutputVariableType

    def travel(_mbs: Any, t: float, _item: int, _parameters: Any) -> list[float]:
        return [0.0, 0.0, heights[round(t * last)], 0.0, 0.0, 0.0]

    def path(tolerance: float) -> np.ndarray:
        mbs = exu.SystemContainer().AddSystem()
        carrier, found = wishbone(mbs, points, travel), [np.zeros(6)]

        def record(mbs: Any, _: float) -> bool:
            place = mbs.GetObjectOutputBody(carrier, kinds.Position, [0.0] * 3)
            x, y, _ = place - points["wheel_centre"]
            r = mbs.GetObjectOutputBody(carrier, kinds.RotationMatrix, [0.0] * 3).reshape(3, 3)
            angles = [np.arctan2(-r[0, 1], r[1, 1]), np.arcsin(r[2, 1])]
            found.append([x, y, -np.arcsin(r[2, 0]), *angles, 0.0])
            return True

        mbs.SetPostStepUserFunction(record)
        mbs.Assemble()
        settings = exu.SimulationSettings()
        how, newton = settings.staticSolver, settings.staticSolver.newton
        how.numberOfLoadSteps, how.verboseMode = last, 0
        newton.relativeTolerance = newton.absoluteTolerance = tolerance
        settings.solutionSettings.writeSolutionToFile = False
        mbs.SolveStatic(settings)
        return np.array(found[-last - 1 :])

    make = lambda tolerance: lambda: path(tolerance)  # noqa: E731
    return {"Exudyn": Curve(make, decades(1e-4, 1e-12, 1), delivers="outputs")}


def container(matrix: Any) -> Any:
    """A sparse matrix for Exudyn."""
    found = exu.MatrixContainer()
    found.SetWithSparseMatrix(csr_matrix(matrix), *matrix.shape, useDenseMatrix=False)
    return found


def structure(case: Case) -> dict[str, Curve]:
    """Generalised-alpha method of Exudyn; port forces and their derivatives are called back."""
    system, spacing = case.model.system, case.maneuver.times[1]
    s, law, ports, n = system.structure, system.law, system.structure.ports.tocsr(), case.model.size
    damping = s.damping_time * s.stiffness + s.dampers @ s.dampers.T
    cq, cv, ca, cf = (matrix.tocsr() for matrix in s.outputs)

    def march(h: float, inputs: np.ndarray) -> np.ndarray:
        def at(t: float, q: Any, v: Any) -> np.ndarray:
            u = inputs[min(round(t / h), len(inputs) - 1)]
            return law.at(ports.T @ np.asarray(q), ports.T @ np.asarray(v), u)

        def force(_mbs: Any, t: float, _item: int, q: Any, v: Any) -> np.ndarray:
            return ports @ at(t, q, v)[:, 0]

        def jacobian(*given: Any) -> Any:
            _, t, _, q, v, of_q, of_v = given
            slopes = at(t, q, v)
            inner = diags_array(of_q * slopes[:, 1] + of_v * slopes[:, 2])
            return container(-(ports @ inner @ ports.T))

        def record(mbs: Any, t: float) -> bool:
            if round(t / h) % round(spacing / h) == 0:
                data = mbs.systemData
                q, v = np.array(data.GetODE2Coordinates()), np.array(data.GetODE2Coordinates_t())
                forces = at(t, q, v)[:, 0] + law.static[1]
                a = np.array(data.GetODE2Coordinates_tt())
                found[round(t / spacing)] = cq @ q + cv @ v + ca @ a + cf @ forces
            return True

        mbs, zeros = exu.SystemContainer().AddSystem(), np.zeros(n)
        start = {"initialCoordinates": zeros, "initialCoordinates_t": zeros}
        start |= {"referenceCoordinates": zeros, "numberOfODE2Coordinates": n}
        matrices = {"massMatrix": s.mass, "stiffnessMatrix": s.stiffness, "dampingMatrix": damping}
        given = {key: container(matrix) for key, matrix in matrices.items()}
        given |= {"forceUserFunction": force, "jacobianUserFunction": jacobian}
        node = mbs.AddNode(exu.itemInterface.NodeGenericODE2(**start))
        mbs.AddObject(exu.itemInterface.ObjectGenericODE2(nodeNumbers=[node], **given))
        found = {0: cf @ (at(0.0, zeros, zeros)[:, 0] + law.static[1])}
        mbs.SetPostStepUserFunction(record)
        mbs.Assemble()
        mbs.SolveDynamic(integration(len(inputs) - 1, case.maneuver.duration))
        return np.array([found[k] for k in range(len(case.reference))])

    def make(h: float) -> Any:
        steps = round(case.maneuver.duration / h)
        inputs = case.maneuver.at(np.linspace(0.0, case.maneuver.duration, steps + 1))
        return lambda: march(h, inputs)

    return {"Exudyn": Curve(make, case.more[:4], delivers="outputs")}


def integration(steps: int, duration: float) -> Any:
    """Settings of the integrator, as ours has them."""
    settings = exu.SimulationSettings()
    how = settings.timeIntegration
    how.numberOfSteps, how.endTime, how.verboseMode = steps, duration, 0
    how.generalizedAlpha.spectralRadius = 0.8
    how.generalizedAlpha.computeInitialAccelerations = False
    how.newton.useModifiedNewton = True
    how.newton.relativeTolerance = how.newton.absoluteTolerance = 1e-7
    settings.solutionSettings.writeSolutionToFile = False
    settings.linearSolverType = exu.LinearSolverType.EigenSparse
    return settings
