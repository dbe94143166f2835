"""Flies by what telemetry says as far as that can be true."""
