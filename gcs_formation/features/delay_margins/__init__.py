"""Compares the loops' delays with their margins in flight, and acts on it."""
