"""One time loop, and integrators that give it a step, one in each file."""
