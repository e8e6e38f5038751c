"""The suspension solved all over its reach.

`python -m tests.reference.suspension_reach` solves 3,240 points, 60 racks by 54 heights, each from
the design position, and says how many have failed or lie on another branch.
"""

import sys

import numpy as np

from vehiclemor.exceptions import VehiclemorError
from vehiclemor.simulation.algebraic import AlgebraicModel
from vehiclemor.simulation.build import build

RACKS = np.linspace(-0.1, 0.1, 60)
HEIGHTS = 54


def points(model: AlgebraicModel, racks: np.ndarray, count: int) -> np.ndarray:
    """Inputs (racks, count, 2): at each rack heights of the whole reach, closer at its ends."""
    shares = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, count))
    limits = np.array([model.reach(rack) for rack in racks])
    heights = limits[:, :1] + shares * (limits[:, 1:] - limits[:, :1])
    # Rounding must not lead out of the reach.
    heights = np.clip(heights, limits[:, :1], limits[:, 1:])
    return np.stack([heights, np.repeat(racks[:, None], count, axis=1)], axis=2)


def is_on_branch(model: AlgebraicModel, q: np.ndarray, u: np.ndarray) -> bool:
    """Whether a position solves the equations this side of every fold and stop.

    Between the design position and the stops only the side of a fold tells branches apart: the
    sign of the Jacobian's determinant.
    """
    sides = [
        np.linalg.slogdet(model.jacobian(*where)).sign
        for where in ((model.design, np.zeros(2)), (q, u))
    ]
    stops = model.definition.stops
    within = all(abs(q[model.coordinates.index(name)]) <= stop for name, stop in stops.items())
    return sides[0] == sides[1] and within and np.abs(model.residual(q, u)).max() < 1e-11


def failures(model: AlgebraicModel, grid: np.ndarray) -> tuple[int, int, float]:
    """How many points have failed, how many lie on another branch, and the largest angle (rad)."""
    failed, wrong, largest = 0, 0, 0.0
    for u in grid.reshape(-1, 2):
        try:
            q = model.solve(u)
        except VehiclemorError:
            failed += 1
            continue
        wrong += not is_on_branch(model, q, u)
        largest = max(largest, np.abs(q).max())
    return failed, wrong, largest


def main() -> None:
    model = build("double_wishbone")
    grid = points(model, RACKS, HEIGHTS)
    failed, wrong, largest = failures(model, grid)
    racks = np.linspace(-0.1, 0.1, 20001)
    limits = np.array([model.reach(rack) for rack in racks])
    slopes = np.abs(np.diff(limits, axis=0)).max(axis=0) / (racks[1] - racks[0])
    sys.stdout.write(
        f"{grid[..., 0].size} points: {failed} failed, {wrong} on another branch; largest "
        f"coordinate {largest:.3f} rad; limits change by {slopes.max():.2f} m for 1 m of rack\n"
    )


if __name__ == "__main__":
    main()
