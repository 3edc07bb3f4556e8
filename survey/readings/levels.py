"""From which size on a reading is called doubtful: one number for the room and for the report."""

CRITICAL = 3.29
"""Standard deviations that a correct reading exceeds once in a thousand, to either side."""
