"""PX4s: fixed wings and multirotors."""
