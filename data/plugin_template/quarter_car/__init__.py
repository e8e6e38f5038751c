"""A plug-in of vehiclemor: a model, a maneuver and a reduction method."""
