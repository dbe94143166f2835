"""Bounds commanded heights by those of path and slot."""
