"""Reduction methods, one in each file; none knows another."""
