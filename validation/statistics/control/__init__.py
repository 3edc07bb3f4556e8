"""Control charts: whether what is measured day by day is still what it was."""
