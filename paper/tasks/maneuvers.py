"""Ten thousand steering maneuvers of ten seconds: what the tasks begin with."""

import numpy as np

RUNS, rng = 10_000, np.random.default_rng(1)
t = np.linspace(0.0, 10.0, 201)  # s
rate, phase = rng.uniform(0.5, 4.0, (RUNS, 3, 1)), rng.uniform(0.0, 6.28, (RUNS, 3, 1))
onset = np.tanh(np.maximum(t - 1.0, 0.0)) ** 2
steering = 0.01 * onset * np.sin(rate * t + phase).sum(axis=1)  # rad, a row for each run
