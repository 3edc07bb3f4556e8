"""Fixes of RTK-GPS receivers and the files they come in."""
