"""The geometry of the knots alone: hull, domain, knots on its edges, regular decompositions, and rates of limits."""
