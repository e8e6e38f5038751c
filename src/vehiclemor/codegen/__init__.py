"""Machine code for the equations of models, and their derivatives: generated, compiled, cached."""
