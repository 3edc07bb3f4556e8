"""Poses in time: what a ground truth that moves consists of."""
