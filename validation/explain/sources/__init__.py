"""Whose errors they are."""
