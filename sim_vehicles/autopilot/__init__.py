"""An emulated ArduPlane's autopilot: modes, commands, missions, parameters, telemetry."""
