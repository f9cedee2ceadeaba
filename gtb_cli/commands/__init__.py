"""The commands of `gtb`, one module each: load, compute, write. They are imported when they are called."""
