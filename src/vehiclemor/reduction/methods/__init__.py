"""Reduction methods, kindred ones in one file; files know nothing of one another."""
