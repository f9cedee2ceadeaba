"""Patch, model or family of patches to mesh."""
