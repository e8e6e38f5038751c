"""What drives a model: maneuvers such as a lane change, and signals through samples."""
