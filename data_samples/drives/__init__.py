"""Synthetic drives over a campus."""
