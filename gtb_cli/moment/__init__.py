"""The moment map μ(s), and the solver of μ(s) = p."""
