"""Logs of scanners and wheels, and the decisions of people."""
