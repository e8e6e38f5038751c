"""Vehicle models: a suspension, a car with 14 degrees of freedom, a car with constraints."""
