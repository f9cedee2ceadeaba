"""Processes that share work, here or on a cluster, the memory that limits leave them, and the versions they run."""
