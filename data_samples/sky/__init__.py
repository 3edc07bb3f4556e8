"""Satellites like those of GPS and Galileo, and the files that tell of them."""
