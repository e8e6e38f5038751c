"""Study files: grids of one model, and protocols with training, validation and test."""
