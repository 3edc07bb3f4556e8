"""How accurate a survey is, would be, and need be."""
