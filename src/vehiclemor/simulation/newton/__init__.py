"""Newton's method for mechanisms along an input: sample by sample, or eight at once."""
