"""Work as independent pieces: kept by what they depend on, done by processes or a cluster."""
