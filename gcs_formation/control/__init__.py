"""States now to setpoints: mixer, fuzzy scheduler, PID, envelope. Pure functions on arrays."""
