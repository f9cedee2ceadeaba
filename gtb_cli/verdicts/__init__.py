"""Whether two files, or all of two folders, agree, and the words for it."""
