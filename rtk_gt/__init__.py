"""Outdoor ground truth: the path of a vehicle from three or more RTK-GPS receivers on its roof."""
