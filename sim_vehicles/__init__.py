"""Emulated autopilots that speak MAVLink as an ArduPlane does."""
