"""The panels that belong to no system: what to do, and the report."""
