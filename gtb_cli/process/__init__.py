"""Ways in which this process works: threads and memory."""
