"""Vehicle models, each derived symbolically in a file of its own."""
