"""Sample campaigns: the published one, synthetic rooms, and drives over a campus."""
