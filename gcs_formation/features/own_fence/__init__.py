"""Keeps commanded heights within the geofences that vehicles have themselves."""
