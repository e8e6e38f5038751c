"""Compiled polynomials for reduced mechanisms."""
