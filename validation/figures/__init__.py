"""Figures of errors, and how figures become files."""
