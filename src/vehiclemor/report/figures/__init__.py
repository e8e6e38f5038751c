"""Figures of the paper, drawn from stored results."""
