"""What stands first in a report: one page, and what to do next."""
