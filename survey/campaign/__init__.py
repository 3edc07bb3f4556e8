"""The survey of a campaign folder."""
