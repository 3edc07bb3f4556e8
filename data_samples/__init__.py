"""Sample campaigns: the published one and the synthetic room."""
