"""Newton iterations of kinematic models along a path: sample by sample, or eight at once."""
