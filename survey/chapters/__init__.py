"""What else a survey's files can show: one chapter of the report each."""
