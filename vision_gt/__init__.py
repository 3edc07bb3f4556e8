"""Robot poses from cameras and markers: of stops in a room, and of a robot that drives."""
