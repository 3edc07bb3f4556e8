"""Prints as pixels show them: how they look, and what of them is fitted to the grey levels."""
