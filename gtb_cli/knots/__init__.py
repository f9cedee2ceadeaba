"""The geometry of the knots alone: hull, domain, faces, and the regular decompositions that liftings induce."""
