"""README and handbook agree with what is there."""
