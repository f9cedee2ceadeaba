"""Verdicts on files of meshes and specs: two files, or all of two folders, compared, and what is said of them."""
