"""Sensors on the vehicle: their times, places and clouds."""
