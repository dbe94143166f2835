"""Identification: the model of a vehicle's autopilot from what it was told and how it flew."""
