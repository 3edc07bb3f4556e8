"""Poses taken over from elsewhere: tables of stops, and trajectories."""
