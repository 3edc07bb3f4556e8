"""The robot as it drives: a stream of poses from each camera, their clocks, one trajectory."""
