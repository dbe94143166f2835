"""Requests messages again that stop coming as requested."""
