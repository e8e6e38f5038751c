"""Comparison with the published numbers, tables and figures."""
