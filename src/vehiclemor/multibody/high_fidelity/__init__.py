"""The high-fidelity vehicle: double wishbones, trailing arms, constraints, Fiala tires."""
