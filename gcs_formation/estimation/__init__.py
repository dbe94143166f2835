"""Estimates of the present states from delayed ones."""
