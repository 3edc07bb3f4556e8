"""Errors of a system, and what they amount to."""
