"""Delayed states to states now."""
