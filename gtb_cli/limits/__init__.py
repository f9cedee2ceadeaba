"""Limits of patches: toric degenerations, and knots that move to the places of others."""
