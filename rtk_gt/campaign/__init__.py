"""RTK-GPS of a campaign folder."""
