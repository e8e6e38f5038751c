"""The film on the first page: a lane change that the reduced models were not trained on.

Usage: python paper/film.py [FILE.gif]
"""

import sys

import numpy as np

import vehiclemor as vm

FILE = "docs/_static/lane-change.gif"
# Factors of frequency and amplitude of the lane changes that all learn from, as in `unseen-inputs`.
TRAINING = (1.0, 1.0), (1.0, -1.4), (1.6, 1.4), (0.7, -1.2)
SECONDS, STEP, PLAYED = 6.5, 0.02, 4.6


def main(file: str = FILE) -> None:
    """Simulate the full order, POD of two ranks and the slow manifold, and write the film."""
    car = vm.model("independent_suspension_vehicle")
    turn = vm.maneuver("lane_change", frequency=1.2, amplitude=-1.0)
    training = [vm.maneuver("lane_change", *factors) for factors in TRAINING]
    reduced = [
        vm.reduce(car, "pod", rank=3, training=training),
        vm.reduce(car, "pod", rank=8, training=training),
        vm.reduce(car, "slow_manifold", training=training),
    ]
    times = STEP * np.arange(round(SECONDS / STEP) + 1)
    runs = [model.simulate(turn).chosen(times=times) for model in (*reduced, car)]
    labels = ["POD, r = 3", "POD, r = 8", "slow manifold", "full order"]
    print(f"written: {vm.animate(*runs, labels=labels, duration=PLAYED, out=file)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
