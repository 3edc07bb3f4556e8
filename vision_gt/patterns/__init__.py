"""Boards and markers."""
