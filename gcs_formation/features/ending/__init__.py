"""Ends a flight with vehicles at separate heights, here, at home or on the ground."""
