"""Limits of patches: toric degenerations, and knots that move to other knots."""
