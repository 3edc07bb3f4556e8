"""Formats of camera files, one module for each program or two."""
