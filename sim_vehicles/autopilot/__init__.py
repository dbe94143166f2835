"""An emulated autopilot: its modes, commands, missions, parameters and telemetry."""
