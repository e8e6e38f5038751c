"""Studies: many runs declared in a file, computed, stored and combined into one dataset."""
