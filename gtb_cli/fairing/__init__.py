"""Energies of surfaces, and the control points that minimise them: fair surfaces, fits through points."""
