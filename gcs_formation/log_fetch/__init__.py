"""Fetches the autopilots' own logs after a flight, and lays their clocks beside the flight's."""
