"""A vehicle's path from its receivers."""
