"""Patch or model to mesh: recipes, too many faces, cells joined along edges, refinement, welding, requirements."""
