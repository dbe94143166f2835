"""Resumes a flight whose station was killed."""
