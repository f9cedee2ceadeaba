"""Patch or model to mesh."""
