"""Reduced models on inputs that they have not seen, and the paper's own terms."""
