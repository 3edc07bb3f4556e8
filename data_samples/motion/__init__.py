"""A robot that drives through a room, seen by cameras with clocks of their own."""
