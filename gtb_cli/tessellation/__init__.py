"""Patch or model to mesh: recipes, cells joined along edges, refinement, welding, solids made, requirements."""
