"""Solids to print: tubes, thickened surfaces, their rims and walls, and faults such as crossings."""
