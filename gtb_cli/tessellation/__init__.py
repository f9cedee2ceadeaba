"""Patch or model to mesh: recipes, cells joined along edges, refinement within a tolerance, welding, requirements."""
