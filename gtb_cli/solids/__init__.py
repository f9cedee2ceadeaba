"""Solids to print: tubes, thickened surfaces, their rims and walls, faults, and what a printer asks."""
