"""Structures: sparse matrices of linear elastic bodies, and ports through which forces act.

    M q'' + (W W' + d K) q' + K q = load + B f(w, w', u),   w = B' q

Springs, dampers and tires act between few points.  Their forces f are the law of the ports, which
is declared as other equations are; all else are arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    # Of SciPy's arrays no types are known.
    csc_array = Any


@dataclass(frozen=True, eq=False)
class Structure:
    """Matrices of a structure with n coordinates, p ports and some outputs.

    Outputs are those of the motion about the static state, but for the forces:
    y = Cq (q - q0) + Cv q' + Ca q'' + Cf f.
    """

    # M and K (n, n), symmetric; K without what acts at the ports.
    mass: csc_array
    stiffness: csc_array
    damping_time: float  # d in s, of damping that is proportional to K.
    # W (n, k): few linear dampers, by their deflections times the root of their rates.
    dampers: csc_array
    ports: csc_array  # B (n, p): deflections of the ports are w = B' q.
    load: np.ndarray  # Weight (n,) in N and N m.
    # Cq, Cv, Ca (outputs, n) and Cf (outputs, p).
    outputs: tuple[csc_array, csc_array, csc_array, csc_array]

    def held(self, stiffness: np.ndarray) -> csc_array:
        """K (n, n) with springs of these stiffnesses (p,) at the ports."""
        return self.stiffness + self.ports @ (stiffness[:, None] * self.ports.T)

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.load)
