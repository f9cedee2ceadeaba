"""Surfaces as STEP, IGES and BREP (read by `importers`), exact or fitted, and as VTU with Bézier cells."""
