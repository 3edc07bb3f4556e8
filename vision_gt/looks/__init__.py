"""What the cameras saw, as pictures: found and expected outlines, and what was not used."""
