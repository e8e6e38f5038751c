"""Figures of the paper at their final size; `regenerate.py` calls them."""
