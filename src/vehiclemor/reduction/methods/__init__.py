"""Registered reduction methods, one in each file; none knows another."""
