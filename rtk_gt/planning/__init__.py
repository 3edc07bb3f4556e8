"""Satellites over a place and a day, before the drive, and held against the log after it."""
