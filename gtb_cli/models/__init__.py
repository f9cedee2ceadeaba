"""Models: several patches, which edges are the same or within a weld, how smoothly they meet, and what is open."""
