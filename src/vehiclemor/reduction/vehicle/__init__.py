"""What reduced vehicles are made of."""
