"""What is shown: tables, figures, and the comparison with the published numbers."""
