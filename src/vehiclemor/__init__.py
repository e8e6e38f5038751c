"""vehiclemor: benchmark suite for model order reduction of multibody vehicle models."""
