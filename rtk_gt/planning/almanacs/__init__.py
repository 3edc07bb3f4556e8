"""Almanac files of all kinds, and where their satellites are."""
