"""Parts of reduced vehicles: slow modes, features of the tires, training runs, decoding."""
