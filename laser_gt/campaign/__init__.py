"""Laser GT of a campaign folder."""
