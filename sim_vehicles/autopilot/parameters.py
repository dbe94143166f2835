"""Parameters with ArduPlane's names and types: those that affect an emulated vehicle.

Source: MAVLink guide, "Parameter Protocol"; ArduPilot documentation, "Complete Parameter List".
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from typing import NamedTuple

from airlink import mavlink as m
from airlink.endpoint import Address
from airlink.messages.parameter import ParamRequestRead, ParamSet, ParamValue
from sim_vehicles.config import VehicleConfig

UNINDEXED = 65535
"""Index in the answer to a request by name."""
WIDER_THAN_TIGHTEST = 1.3
LOITER_RADIUS_M = 60.0
ROLL_LIMIT_DEG = 45.0
GRAVITY_MPS2 = 9.80665
MAX_LISTS = 16
"""Lists sent at the same time; a further request gets no answer, as from a busy autopilot."""


class Kind(NamedTuple):
    """A parameter's type and range; a value outside it is set to the nearest bound."""

    type: int
    least: float
    most: float


def _floating(least: float, most: float) -> Kind:
    return Kind(m.MAV_PARAM_TYPE_REAL32, least, most)


KINDS: dict[str, Kind] = {
    "AIRSPEED_CRUISE": _floating(5, 100),
    "AIRSPEED_MAX": Kind(m.MAV_PARAM_TYPE_INT16, 5, 100),
    "AIRSPEED_MIN": Kind(m.MAV_PARAM_TYPE_INT16, 5, 100),
    "ARMING_CHECK": Kind(m.MAV_PARAM_TYPE_INT32, 0, 2**24),
    "AUTOLAND_WP_ALT": Kind(m.MAV_PARAM_TYPE_INT16, 10, 200),
    "AUTOLAND_WP_DIST": Kind(m.MAV_PARAM_TYPE_INT16, 100, 700),
    "FS_GCS_ENABL": Kind(m.MAV_PARAM_TYPE_INT8, 0, 1),
    "FS_LONG_ACTN": Kind(m.MAV_PARAM_TYPE_INT8, 0, 4),
    "FS_LONG_TIMEOUT": _floating(1, 300),
    "LAND_DISARMDELAY": Kind(m.MAV_PARAM_TYPE_INT8, 0, 127),
    "MAV_GCS_SYSID": Kind(m.MAV_PARAM_TYPE_INT16, 1, 255),
    "MAV_SYSID": Kind(m.MAV_PARAM_TYPE_INT16, 1, 255),
    "ROLL_LIMIT_DEG": _floating(0, 90),
    "RTL_ALTITUDE": _floating(10, 1000),
    "TKOFF_ALT": Kind(m.MAV_PARAM_TYPE_INT16, 10, 200),
    "WP_LOITER_RAD": Kind(m.MAV_PARAM_TYPE_INT16, 1, 32767),
    "WP_RADIUS": Kind(m.MAV_PARAM_TYPE_INT16, 1, 32767),
}
NAMES = tuple(KINDS)
FIXED = frozenset({"MAV_SYSID"})
"""Parameters that can't be changed without a reboot."""


def initial_values(config: VehicleConfig, cruise_mps: float) -> dict[str, float]:
    """Return the initial parameters of a vehicle."""
    tightest_m = cruise_mps / config.model.turn_rate_max_rps
    return {
        "AIRSPEED_CRUISE": cruise_mps,
        "AIRSPEED_MAX": math.ceil(config.model.speed_max_mps),
        "AIRSPEED_MIN": math.floor(config.model.speed_min_mps),
        "ARMING_CHECK": 1,
        "AUTOLAND_WP_ALT": 55,
        "AUTOLAND_WP_DIST": 400,
        "FS_GCS_ENABL": 0,
        "FS_LONG_ACTN": 0,
        "FS_LONG_TIMEOUT": 5,
        "LAND_DISARMDELAY": 20,
        "MAV_GCS_SYSID": 255,
        "MAV_SYSID": config.identity.system,
        "ROLL_LIMIT_DEG": max(ROLL_LIMIT_DEG, math.ceil(_steepest_deg(config))),
        "RTL_ALTITUDE": 100,
        "TKOFF_ALT": 50,
        "WP_LOITER_RAD": math.ceil(max(LOITER_RADIUS_M, WIDER_THAN_TIGHTEST * tightest_m)),
        "WP_RADIUS": 90,
    }


def _steepest_deg(config: VehicleConfig) -> float:
    """Return the bank of a model's tightest turn at its highest airspeed, degrees."""
    model = config.model
    return math.degrees(math.atan(model.speed_max_mps * model.turn_rate_max_rps / GRAVITY_MPS2))


class ParameterServer:
    """One vehicle's parameters, and the answers to requests for them."""

    def __init__(self, values: dict[str, float], kinds: Mapping[str, Kind] = KINDS) -> None:
        """Start with `values`, one for each name of `kinds`."""
        self._values, self._kinds, self._names = values, kinds, tuple(kinds)
        self._to_list: deque[tuple[Address, int]] = deque()

    def __getitem__(self, name: str) -> float:
        """Return a value."""
        return self._values[name]

    def entries(self) -> list[tuple[str, int, float]]:
        """Return the name, MAV_PARAM_TYPE and value of each."""
        return [(name, kind.type, self._values[name]) for name, kind in self._kinds.items()]

    def is_airspeed(self, speed_mps: float) -> bool:
        """Return whether an airspeed is within the limits."""
        return self["AIRSPEED_MIN"] <= speed_mps <= self["AIRSPEED_MAX"]

    @property
    def listing(self) -> bool:
        """Whether a list is being sent."""
        return bool(self._to_list)

    def begin_list(self, peer: Address) -> None:
        """Start sending the list to a peer, from its beginning."""
        self._to_list = deque(entry for entry in self._to_list if entry[0] != peer)
        if len(self._to_list) <= (MAX_LISTS - 1) * len(self._names):
            self._to_list.extend((peer, index) for index in range(len(self._names)))

    def next_of_list(self) -> tuple[Address, ParamValue] | None:
        """Return the next value of a list and its receiver: one per cycle, so that no peer is flooded."""
        if not self._to_list:
            return None
        peer, index = self._to_list.popleft()
        return peer, self._told(self._names[index], index)

    def read(self, request: ParamRequestRead) -> ParamValue | None:
        """Return the answer to a request by index, or by name if the index is negative; None if there is none."""
        if request.param_index >= 0:
            known = request.param_index < len(self._names)
            return self._told(self._names[request.param_index], request.param_index) if known else None
        return self._told(request.param_id, UNINDEXED) if request.param_id in self._kinds else None

    def set(self, request: ParamSet) -> ParamValue | None:
        """Change a value, whatever type it is sent as, and return the new one; None if there is no such parameter."""
        name, value = request.param_id, request.param_value
        kind = self._kinds.get(name)
        if kind is None or not math.isfinite(value):
            return None
        if name not in FIXED:
            within = min(max(value, kind.least), kind.most)
            self._values[name] = within if kind.type == m.MAV_PARAM_TYPE_REAL32 else int(within)
        return self._told(name, UNINDEXED)

    def _told(self, name: str, index: int) -> ParamValue:
        kind, value = self._kinds[name].type, self._values[name]
        return ParamValue(
            name, value if kind == m.MAV_PARAM_TYPE_REAL32 else round(value), kind, len(self._names), index
        )
