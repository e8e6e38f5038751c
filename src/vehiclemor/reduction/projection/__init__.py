"""Bases of control periods, and the equations of a model projected on them (POD)."""
