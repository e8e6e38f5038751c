"""The high-fidelity vehicle in other coordinates than its own: constants and kernels."""
