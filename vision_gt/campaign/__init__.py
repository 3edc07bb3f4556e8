"""Vision GT of a campaign folder."""
