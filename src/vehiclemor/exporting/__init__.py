"""Models for other tools: C, functional mock-up units (FMU), CasADi, JAX."""
