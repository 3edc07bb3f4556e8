"""Field entry of hand-laser readings: quick, safe against accidents, checked in the room."""
