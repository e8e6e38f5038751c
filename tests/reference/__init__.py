"""Comparisons with independent formulations and libraries."""
