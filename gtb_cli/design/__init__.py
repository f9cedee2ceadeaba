"""Design: curves and surfaces through points, filled holes, and patches from files of other programs."""
