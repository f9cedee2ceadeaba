"""Figures for print, and animated GIFs, drawn by matplotlib."""
