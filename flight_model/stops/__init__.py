"""Paths of legs for vehicles that can hover: they turn at a point, stop for a time, and slow down into corners.

`pacing` is how speeds change between points where they are given, `corners` how fast each waypoint is passed, or that
it is stopped at, `path` the legs between stops as one path, `timetable` when the leader is where on it, `turning` how
long a turn in place takes. Corners that are flown through are the turns of `flight_model.legs`.
"""
