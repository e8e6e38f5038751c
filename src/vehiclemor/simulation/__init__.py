"""Runs of models: integrators in time, Newton's method for mechanisms, batches of runs."""
