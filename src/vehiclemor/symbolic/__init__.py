"""Mechanics with symbols: from bodies, joints and forces to equations of motion (SymPy)."""
