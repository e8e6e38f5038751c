"""A report that is one HTML file: verdicts, tables, figures, provenance, every cell's settings."""
