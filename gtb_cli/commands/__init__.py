"""The commands of `gtb`, a module for one or a few alike: load, compute, write. They are imported when called."""
