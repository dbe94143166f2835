"""Estimates each vehicle's time constants in flight."""
