"""Reduction methods, one in each file, behind the interface of `interface.py`."""
