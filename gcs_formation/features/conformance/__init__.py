"""Notices vehicles that don't do what they acknowledged."""
