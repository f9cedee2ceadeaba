"""Figures for print and films, drawn by matplotlib."""
