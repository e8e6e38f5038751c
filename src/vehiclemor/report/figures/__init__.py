"""Figures: those of the paper, and of any study, run or comparison."""
