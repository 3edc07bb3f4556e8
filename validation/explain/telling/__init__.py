"""What an explanation says, in words, tables and figures."""
