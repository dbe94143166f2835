"""What an emulated autopilot flies and senses: dynamics, sensors, environment."""
