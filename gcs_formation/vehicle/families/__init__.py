"""Families of autopilots as they are commanded: folders, found by being there (`extend/autopilots.py`)."""
