"""Readings of a hand-held laser and the points between which they are."""
