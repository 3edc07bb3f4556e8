"""A lab's own code: a solver, a localisation, a report."""
