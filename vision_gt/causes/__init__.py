"""What went wrong: hypotheses with one set of numbers each, tried against all that images show."""
