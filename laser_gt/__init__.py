"""Robot poses from laser scans (not built yet)."""
