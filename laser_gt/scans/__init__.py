"""Scans, their surfaces, and poses in the plane."""
