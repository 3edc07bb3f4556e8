"""Constant offsets of receivers and the noise of their fixes."""
