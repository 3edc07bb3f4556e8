"""Outdoor ground truth: the path of a vehicle from RTK-GPS receivers on its roof, one or more."""
