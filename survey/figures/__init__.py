"""Figures of the survey: maps, residuals, what the studies found."""
