"""What is taken for granted of receivers on a vehicle; settings and estimators share it."""

SIMULTANEOUS = 0.005
"""Stamps this near in seconds are the same: a judgement. Receivers are tied to the satellites'
time; stamps of one moment differ by rounding, those of neighbours at 20 Hz by 50 ms."""
ETA = 1.75
"""Vertical over horizontal noise of a fix, as the text of Blanco 2009 has it."""
CONFIDENCE = 0.99
"""Level of the consistency bound: of 100 good poses one passes it."""
VEHICLE_SIZE = 10.0
"""Antennas of one vehicle are within so many metres: a judgement, for cars and lorries."""
FEWEST_STEPS = 10
"""Common times that offsets need: one more than the 9 offsets and distances of three receivers."""
