"""README and pages agree with what is there."""
