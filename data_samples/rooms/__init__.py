"""Synthetic rooms with scanners and cameras."""
