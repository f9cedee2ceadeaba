"""Processes that share work, here or on a cluster, the memory they may use, and the versions they run."""
