"""Poses of named stops with their covariances."""
