"""Hand-laser survey: distances to world points and robot frames, the validation poses."""
