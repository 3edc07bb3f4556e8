"""Cameras before they are mounted: what they will see, and how well."""
