"""Settings for every test: hypothesis gives the same examples on every machine and has no clock."""

import pytest
from hypothesis import settings

settings.register_profile("gtb", deadline=None, derandomize=True, max_examples=50)
settings.register_profile("quick", settings.get_profile("gtb"), max_examples=15)


def pytest_configure(config: pytest.Config) -> None:
    """Try fewer examples where `make test` leaves out what is long."""
    settings.load_profile("quick" if config.option.markexpr == "not long" else "gtb")
