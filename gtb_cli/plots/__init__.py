"""Figures for print, and films as GIF, drawn by matplotlib."""
