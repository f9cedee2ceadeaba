"""Limits of patches: toric degenerations, and knots that move to other knots, with the films that they leave."""
