"""Adjustment of images of known points."""
