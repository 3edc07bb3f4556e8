"""Poses of a motion-capture rig for gtval."""
