"""Identification: the model of a vehicle's autopilot from what it was commanded and how it flew."""
