"""The geometry of the knots alone: hull, domain and which knots lie on its edges, faces, and regular decompositions."""
