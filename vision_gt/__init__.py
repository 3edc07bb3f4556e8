"""Robot poses from cameras and markers (not built yet)."""
