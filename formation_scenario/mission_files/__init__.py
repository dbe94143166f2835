"""Missions and tracks from files of other programs: QGroundControl, Mission Planner, Google Earth, GPS receivers.

Read in this order: `mission` (what a file says, whatever its format), one module per format, `commands` (which MAVLink
commands there are to fly), `route` (the mission carried out on paper: where it goes, how fast, what isn't flown).
"""

from __future__ import annotations

from formation_scenario.mission_files.formats import FORMATS, read_mission
from formation_scenario.mission_files.mission import Mission, MissionFileError, MissionItem
from formation_scenario.mission_files.route import Route, RoutePoint, route_of

__all__ = ["FORMATS", "Mission", "MissionFileError", "MissionItem", "Route", "RoutePoint", "read_mission", "route_of"]
