"""Settings for every test: hypothesis gives the same examples on every machine and has no clock."""

from hypothesis import settings

settings.register_profile("gtb", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("gtb")
