"""Studies: grids of cells declared as data, executed, stored and combined."""
