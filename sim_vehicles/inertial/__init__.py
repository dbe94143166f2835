"""Inertial navigation: sensors, alignment, strap-down mechanisation, errors. East, north, up; right, forward, up."""
