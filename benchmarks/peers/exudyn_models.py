"""Exudyn: the double wishbone of rigid bodies and joints, and the truck from its matrices."""

from typing import Any

import exudyn as exu
import numpy as np
from clock import Case, Curve, decades
from exudyn.itemInterface import (
    MarkerBodyRigid,
    NodeGenericODE2,
    ObjectGenericODE2,
    ObjectJointGeneric,
)
from exudyn.rigidBodyUtilities import RigidBodyInertia
from scipy.sparse import csr_matrix, diags_array


def mechanism(case: Case) -> dict[str, Curve]:
    """Newton's method for all constraints at each sample: as many as there are coordinates."""
    points = {k: np.array(v) for k, v in case.model.parameters.values().items()}
    heights, times = case.maneuver.at(case.maneuver.times)[:, 0], case.maneuver.times

    def make(tolerance: float) -> Any:
        def path() -> np.ndarray:
            mbs = exu.SystemContainer().AddSystem()
            ground = mbs.CreateGround()
            inertia = RigidBodyInertia(1.0, np.eye(3))
            place = points["wheel_centre"].tolist()
            kind = exu.NodeType.RotationRxyz
            upper, lower, carrier = (
                mbs.CreateRigidBody(inertia=inertia, referencePosition=place, nodeType=kind)
                for _ in range(3)
            )
            for arm, body in (("upper", upper), ("lower", lower)):
                rear, front = (points[f"{arm}_arm_{end}_pivot"] for end in ("rear", "front"))
                mbs.CreateRevoluteJoint(
                    bodyNumbers=[ground, body], position=rear, axis=front - rear
                )
                ball = points[f"{arm}_ball_joint"]
                mbs.CreateSphericalJoint(bodyNumbers=[body, carrier], position=ball)
            inner, outer = points["tie_rod_inner"], points["tie_rod_outer"]
            mbs.CreateDistanceConstraint(
                bodyNumbers=[ground, carrier],
                localPosition0=inner,
                localPosition1=outer - points["wheel_centre"],
                distance=float(np.linalg.norm(outer - inner)),
            )
            fixed = mbs.AddMarker(MarkerBodyRigid(bodyNumber=ground, localPosition=place))
            wheel = mbs.AddMarker(MarkerBodyRigid(bodyNumber=carrier))

            def height(_mbs: Any, t: float, _item: int, _parameters: Any) -> list[float]:
                return [0.0, 0.0, heights[round(t * (len(times) - 1))], 0.0, 0.0, 0.0]

            mbs.AddObject(
                ObjectJointGeneric(
                    markerNumbers=[fixed, wheel],
                    constrainedAxes=[0, 0, 1, 0, 0, 0],
                    offsetUserFunction=height,
                )
            )
            found = []

            def record(mbs: Any, _: float) -> bool:
                kinds = exu.OutputVariableType
                x, y, _ = mbs.GetObjectOutputBody(carrier, kinds.Position, [0.0] * 3) - place
                r = mbs.GetObjectOutputBody(carrier, kinds.RotationMatrix, [0.0] * 3).reshape(3, 3)
                angles = [np.arctan2(-r[0, 1], r[1, 1]), np.arcsin(r[2, 1])]
                found.append([x, y, -np.arcsin(r[2, 0]), *angles, 0.0])
                return True

            mbs.SetPostStepUserFunction(record)
            mbs.Assemble()
            settings = exu.SimulationSettings()
            settings.staticSolver.numberOfLoadSteps = len(times) - 1
            settings.staticSolver.newton.relativeTolerance = tolerance
            settings.staticSolver.newton.absoluteTolerance = tolerance
            settings.solutionSettings.writeSolutionToFile = False
            settings.staticSolver.verboseMode = 0
            mbs.SolveStatic(settings)
            return np.array([np.zeros(6), *found][-len(times) :])

        return path

    return {"Exudyn": Curve(make, decades(1e-4, 1e-12, 1), np.asarray, "outputs")}


def structure(case: Case) -> dict[str, Curve]:
    """Generalised-alpha method of Exudyn; port forces and their derivatives are called back."""
    system = case.model.system
    s, law, spacing = system.structure, system.law, case.maneuver.times[1]
    ports, n = s.ports.tocsr(), s.size
    damping = s.damping_time * s.stiffness + s.dampers @ s.dampers.T
    cq, cv, ca, cf = (matrix.tocsr() for matrix in s.outputs)

    def container(matrix: Any) -> Any:
        found = exu.MatrixContainer()
        found.SetWithSparseMatrix(csr_matrix(matrix), n, n, useDenseMatrix=False)
        return found

    def make(h: float) -> Any:
        every = round(spacing / h)
        inputs = case.maneuver.at(np.linspace(0.0, case.maneuver.duration, every * 250 + 1))

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

        def march() -> np.ndarray:
            mbs, zeros = exu.SystemContainer().AddSystem(), np.zeros(n)
            node = mbs.AddNode(
                NodeGenericODE2(
                    referenceCoordinates=zeros,
                    initialCoordinates=zeros,
                    initialCoordinates_t=zeros,
                    numberOfODE2Coordinates=n,
                )
            )
            mbs.AddObject(
                ObjectGenericODE2(
                    nodeNumbers=[node],
                    massMatrix=container(s.mass),
                    stiffnessMatrix=container(s.stiffness),
                    dampingMatrix=container(damping),
                    forceUserFunction=force,
                    jacobianUserFunction=jacobian,
                )
            )
            found = {}

            def record(mbs: Any, t: float) -> bool:
                if round(t / h) % every == 0:
                    data = mbs.systemData
                    q, v = (
                        np.array(data.GetODE2Coordinates()),
                        np.array(data.GetODE2Coordinates_t()),
                    )
                    forces = at(t, q, v)[:, 0] + law.static[1]
                    a = np.array(data.GetODE2Coordinates_tt())
                    found[round(t / spacing)] = cq @ q + cv @ v + ca @ a + cf @ forces
                return True

            found[0] = cf @ (at(0.0, zeros, zeros)[:, 0] + law.static[1])
            mbs.SetPostStepUserFunction(record)
            mbs.Assemble()
            settings = exu.SimulationSettings()
            how = settings.timeIntegration
            how.numberOfSteps, how.endTime = len(inputs) - 1, case.maneuver.duration
            how.generalizedAlpha.spectralRadius = 0.8
            how.generalizedAlpha.computeInitialAccelerations = False
            how.newton.useModifiedNewton, how.verboseMode = True, 0
            how.newton.relativeTolerance = how.newton.absoluteTolerance = 1e-7
            settings.solutionSettings.writeSolutionToFile = False
            settings.linearSolverType = exu.LinearSolverType.EigenSparse
            mbs.SolveDynamic(settings)
            return np.array([found[k] for k in range(len(case.reference))])

        return march

    read = lambda y: y / case.more["ranges"]  # noqa: E731
    return {"Exudyn": Curve(make, case.more["steps"][:4], read, "outputs")}
