"""Studies: grids of runs declared as data, executed, stored and combined."""
