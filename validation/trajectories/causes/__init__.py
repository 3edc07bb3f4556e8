"""Causes of the errors of a moving source: frame, mount, scale, delay, and what drifts."""
