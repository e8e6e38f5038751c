"""Plans of experiments: grids of one model, and protocols with training, validation and test."""
