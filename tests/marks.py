"""What `make test` leaves out and `make test-all` runs."""

from collections.abc import Iterable

import pytest

# For a test that takes long by nature, or repeats with other seeds, sizes or specs what a short one shows
long = pytest.mark.long


def mostly_long(values: Iterable[object], quick: int = 1) -> list[object]:
    """Values of a parametrisation, of which all but the first ones are long; several names take tuples."""
    return [
        value if index < quick else pytest.param(*(value if isinstance(value, tuple) else (value,)), marks=long)
        for index, value in enumerate(values)
    ]
