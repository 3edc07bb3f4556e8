"""A whole log of a driving robot becomes a trajectory."""
