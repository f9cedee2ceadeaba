"""Energies of surfaces, and the control points for which they are least."""
