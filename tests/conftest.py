"""Settings that all tests share."""

from hypothesis import settings

# How long an example takes says more of the machine than of the code.
settings.register_profile("gtval", deadline=None)
settings.load_profile("gtval")
