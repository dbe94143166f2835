"""Ends a flight when no vehicle is left in the air."""
