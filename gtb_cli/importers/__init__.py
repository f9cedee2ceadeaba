"""Files of other programs as patches."""
