"""How the patches of a model go together: seams between them, and what may be required of the whole."""
