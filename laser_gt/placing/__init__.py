"""Stops placed by their matches."""
