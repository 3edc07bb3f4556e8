"""Robot poses from laser scans that are matched: of stops in a room, and along a drive."""
