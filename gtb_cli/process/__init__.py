"""How work runs: in several processes, on a cluster, within the memory that it may use."""
