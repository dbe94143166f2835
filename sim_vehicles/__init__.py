"""Emulated autopilots that speak MAVLink as ArduPlane, ArduCopter and PX4 do."""
