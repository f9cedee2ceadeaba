"""Energies of surfaces, and the control points that minimise them."""
