"""Handling tests of the standards: numbers of a vehicle's run."""
