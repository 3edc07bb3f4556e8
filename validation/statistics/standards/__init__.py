"""Errors in the words of standards: tolerance, repeatability, success, En numbers, budgets."""
