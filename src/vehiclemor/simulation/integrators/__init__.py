"""Integrators, one in each file, and the one time loop that calls their steps."""
