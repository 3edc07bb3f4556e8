"""Results of a run as files for maps and other programs."""
