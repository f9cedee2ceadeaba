"""Programs and libraries of others that read mesh files, and the files of ours that each can read."""
