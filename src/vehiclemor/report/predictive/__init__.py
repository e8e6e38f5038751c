"""Reduced models on inputs that they have not seen."""
