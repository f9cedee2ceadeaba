"""Surfaces to files, exact where they can be and fitted otherwise: STEP, IGES, BREP, and VTU with Bézier cells."""
