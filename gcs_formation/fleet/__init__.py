"""Membership and conformance: which vehicles are present, and whether they fly as commanded."""
