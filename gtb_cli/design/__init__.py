"""Design: curves and surfaces through points, and filled holes."""
