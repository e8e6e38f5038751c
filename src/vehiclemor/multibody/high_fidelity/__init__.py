"""The high-fidelity vehicle and its other forms."""
