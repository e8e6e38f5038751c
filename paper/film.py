"""The film on the first page: a lane change that the reduced models were not trained on.

Usage: python paper/film.py [FILE.gif]
"""

import sys

import numpy as np

import vehiclemor as vm

FILE = "docs/_static/lane-change.gif"
SECONDS, STEP, PLAYED = 6.5, 0.02, 4.6


def main(file: str = FILE) -> None:
    """Simulate the full order, POD and the slow manifold, and write the film."""
    car = vm.model("independent_suspension_vehicle")
    turn = vm.maneuver("lane_change", frequency=1.2, amplitude=-1.0)
    pod = vm.reduce(car, "pod", rank=3, training="lane_change")
    slow = vm.rom("independent_suspension_vehicle")
    times = STEP * np.arange(round(SECONDS / STEP) + 1)
    runs = [model.simulate(turn).chosen(times=times) for model in (pod, slow, car)]
    labels = ["POD, r = 3", "slow manifold", "full order"]
    print(f"written: {vm.animate(*runs, labels=labels, duration=PLAYED, out=file)}")


if __name__ == "__main__":
    main(*sys.argv[1:])
