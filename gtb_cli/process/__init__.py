"""How this process works: threads, copies of it, memory, disk, progress."""
