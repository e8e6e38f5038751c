"""What training runs have shown: how long they stay where, and what their starts leave behind.

Ranges tell where a run is.  But errors of the heading grow with the time that a run stays there,
those of the place with the way that it drives on with them; and what a start excites, beside the
slow motion, is known for the starts of the training alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from vehiclemor.inputs.maneuver import Maneuver
from vehiclemor.inputs.polynomials import extent_of
from vehiclemor.reduction.trust import inputs_beyond
from vehiclemor.reduction.vehicle.decoding_loops import LEVELS, MOVING, PARTS, STILL
from vehiclemor.sizes import shaped

# A run may last so many times as long as any training run, and this (s) where none has been.
LONGER, SHORTEST = 1.05, 0.1
# Parts of the sizes of the training runs' steering that a run's may have: few of them are as quick
# as the quickest; its derivatives are as in these.
KNOWN = np.array([[0.95, 1.0, 1.0], [0.75, 1.0, 1.0], [0.75, 1.0, 1.0]])
# A start may leave so many times what samples of training runs leave.
UNLIKE = 3.0
# Part of the steered motion's own amplitudes that a start's transient may have beside it.
BESIDE = 0.3
# What is left, beside its modes, of a start's motion when training runs begin to be steered.
FADED = 0.01
# Decay (1/s) that is none.
SLOWEST = 1e-6
# What is told besides ranges, in the order of the loop.
REASONS = (
    "it moves sideways for longer, or has longer ago, than any training run",
    "it moves sideways before what its start excites has decayed",
    "it starts sideways, as no training run does",
    "its start leaves more than the slow motion, unlike any training run",
    "it is steered further or quicker than any training run",
)
BEYOND = np.array([STILL, MOVING, *np.arange(1, PARTS) / PARTS])


@dataclass(frozen=True)
class TrainingReach:
    """What is known of durations and starts."""

    # Seconds (2 columns, levels) that a run may be beyond each level of a range; below them their
    # integrals in s^2.
    lasted: np.ndarray
    sideways: float  # How far the starts use the ranges of these columns.
    # Amplitudes (modes,) that a start's transient may have in a run that is steered.
    decaying: np.ndarray
    # When (s) known starts that excite modes were steered first, 0 if none was, and their
    # amplitudes (modes,).
    faded: float
    steered: np.ndarray
    left: np.ndarray  # What decoding leaves of the states of the shape (n,).
    # Directions (m, n), in parts of `left`, in which known starts leave more, and how far.
    starts: np.ndarray
    begun: np.ndarray
    # Sizes (3, inputs) that the inputs may have between output times too, see `Extent`; nothing is
    # told of them where it is empty.
    inputs: np.ndarray = field(default_factory=lambda: np.zeros((3, 0)))

    def check_sizes(self) -> None:
        """Raise `ValueError` if the amplitudes or the starts don't fit one another."""
        modes, n, starts = len(self.decaying), len(self.left), len(self.begun)
        shaped("lasted", (self.lasted, len(self.lasted), LEVELS))
        shaped("steered", (self.decaying, modes), (self.steered, modes))
        shaped("starts", (self.left, n), (self.starts, starts, n), (self.begun, starts))
        shaped("reach", (self.inputs, 3, *self.inputs.shape[1:2]))

    def driven(self, maneuver: Maneuver) -> tuple[float, float]:
        """How far a maneuver's inputs go, 1 at the edge, and when (s) they pass it."""
        if not self.inputs.size:
            return 0.0, np.inf
        used = float(np.maximum.reduce(extent_of(maneuver).largest / self.inputs, axis=None))
        return used, np.inf if used <= 1.0 else inputs_beyond(maneuver, self.inputs).min()

    def settled(self, excited: np.ndarray) -> float:
        """Time in s from which on a start's transient, as `Decoding.excited` gives it, is known."""
        rates, amplitudes = excited
        if not len(rates) or not len(self.decaying):
            return 0.0
        sizes = np.hypot(*amplitudes.T)
        larger = np.maximum(sizes / self.decaying, 1.0)
        # What does not decay never settles.
        settled = float((np.log(larger) / np.maximum(-rates[:, 0], SLOWEST)).max())
        if not self.faded:
            return settled
        # Slower motion of the start is in the reduced states; it is as large as that of the modes.
        larger = max(float((sizes / self.steered).max()) / FADED, 1.0)
        return max(settled, self.faded * np.log(larger) / -np.log(FADED))

    def unlike(self, remainder: np.ndarray) -> float:
        """How much a start leaves (n,), beside what known starts do; 1 is the edge."""
        if not len(self.left):
            return 0.0
        scaled = remainder / self.left
        known = np.clip(self.starts @ scaled, -LONGER * self.begun, LONGER * self.begun)
        return float(np.abs(scaled - known @ self.starts).max()) / UNLIKE


def known_starts(remainders: np.ndarray, left: np.ndarray) -> dict[str, np.ndarray]:
    """`starts` and `begun` of starts of which decoding leaves so much (starts, n)."""
    scaled = remainders / left
    _, sizes, directions = np.linalg.svd(scaled, full_matrices=False)
    directions = directions[sizes > UNLIKE]
    return {"starts": directions, "begun": np.abs(scaled @ directions.T).max(axis=0)}


NONE = np.zeros(0)
NOTHING_KNOWN = TrainingReach(
    np.zeros((0, LEVELS)), MOVING, NONE, 0.0, NONE, NONE, np.zeros((0, 0)), NONE
)


def durations(times: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Seconds (samples, 2 columns, levels) beyond each level so far, and their integrals."""
    spans = np.diff(times, prepend=times[:1])[:, None, None]
    spent = np.cumsum(spans * (sizes[:, :, None] > BEYOND), axis=0)
    return np.concatenate([spent, np.cumsum(spans * spent, axis=0)], axis=1)
