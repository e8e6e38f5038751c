"""Full-order simulation: compiled solvers, models ready to run, trajectories."""
