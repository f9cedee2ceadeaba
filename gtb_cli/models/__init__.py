"""Models: several patches, which edges are the same or within a weld, how smoothly they meet, and why one is open."""
