"""The clocks of trajectories: delay, drift and jitter of one source's stamps against another's."""
