"""Many campaigns side by side: repeated days of a hall, or the sequences of a data set."""
