"""Patches as Bézier patches: of a higher degree, as curves in them, and in exact rational pieces."""
