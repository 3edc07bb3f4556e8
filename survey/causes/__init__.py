"""One cause for many readings that disagree: hypotheses tried against each other."""
