"""Keeps a reserve in the batteries of vehicles that tell them: before take-off, and for the way home in flight."""
