"""Paths as people plan them: straight legs over the ground, joined by turns.

`turn` is one turn of continuous curvature, `detour` a path of several turns from one straight to another, `joint` what
is flown at a waypoint, `joining` the choice of these for all waypoints, `heights` the profile of heights, `path` the
whole.
"""
