"""Generalized toric-Bézier patches: from a short text description to a mesh."""
