"""Patches as Bézier patches: of a higher degree, and in exact rational pieces."""
