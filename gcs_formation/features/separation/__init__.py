"""Keeps vehicles apart, whatever the law commands."""
