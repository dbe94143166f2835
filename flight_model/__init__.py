"""The mathematics of flight that vehicles and ground station share; it knows no scenario and no message."""
