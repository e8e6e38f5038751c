"""Models in use: reduced or full, stepped, saved and run in batches."""
