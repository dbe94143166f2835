"""Replaces a lost leader by a follower."""
