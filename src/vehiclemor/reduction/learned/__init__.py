"""Models that general learners fit to samples of training runs: coordinates, equations, loop."""
