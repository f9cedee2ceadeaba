"""Tools beside the tests, each with a target of the Makefile; what is measured is in `tests/benchmarks`."""
