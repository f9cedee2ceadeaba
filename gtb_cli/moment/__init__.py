"""The moment map μ(s), and the one solver of μ(s) = p."""
