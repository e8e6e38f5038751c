"""Inputs of models over time: maneuvers, and signals through samples."""
