"""What makes specs: curves through points."""
