"""Verdicts on files of meshes and specs: what `gtb diff` compares, tells and reports."""
