"""World points and robot frames from readings."""
