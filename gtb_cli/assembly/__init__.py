"""Models as assemblies of patches: the seams between these, and requirements on the whole."""
