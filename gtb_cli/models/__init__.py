"""Models: several patches, which of their edges are joined, how smoothly, and what is open."""
