"""Boards and markers found in images."""
