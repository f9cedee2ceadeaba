"""Patch or model to mesh: recipes, subdivision within a tolerance, welding, attributes, requirements."""
