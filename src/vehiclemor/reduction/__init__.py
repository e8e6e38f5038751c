"""Reduced models: how methods make them, how they are run, stepped, trusted and saved."""
