"""Explanations of poses in space, and of positions whose orientation one side does not know."""
