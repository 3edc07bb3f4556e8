"""Cameras calibrated one by one and together."""
