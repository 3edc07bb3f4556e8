"""A drive in a campaign: its files, what is told of it, its system."""
