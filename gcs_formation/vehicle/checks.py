"""Checks of the parameters on which the flight depends, and how they are read.

Source: MAVLink guide, "Parameter Protocol".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import NamedTuple

from airlink import mavlink as m
from airlink.clock import Instant, after
from airlink.messages.command import ParamRequestRead, ParamValue
from flight_model.energy import GRAVITY_MPS2
from formation_scenario.path_plan import PathPlan
from formation_scenario.vehicles import VehicleModel
from gcs_formation.vehicle.parameter_setting import Change, is_untouched

RETRY_S = 0.7
TRIES = 24
"""Attempts for each parameter name; a name unknown to the autopilot gets no answer. With half of all datagrams lost
each way, one parameter in a thousand isn't read."""
TRIES_BEFORE_OLD = 3
"""Attempts for the present name of a parameter before the one that rare versions have is asked for too."""
TRIM_OFF_MPS = 1.0
"""Largest difference between the trim airspeed and the path's speed, m/s."""
SAME_MPS = 0.05
"""Differences of airspeeds below which messages don't mention the air density."""
AT_ONCE = 4
"""Number of requests sent at once: autopilots have a short queue for them."""


class Finding(NamedTuple):
    """A parameter or position that isn't as it should be."""

    text: str
    """What was found, and what is allowed or what will happen."""
    refuses: bool = False
    """Whether it prevents the take-off of all vehicles."""


@dataclass(frozen=True)
class Check:
    """The check of one parameter, whose names in different versions are listed newest first."""

    names: tuple[str, ...]
    allowed: str
    """The allowed values in words, and the effect of others."""
    holds: Callable[[float], bool]
    refuses: Callable[[float], bool] = lambda _: False
    """Whether a value that isn't allowed prevents the take-off of all vehicles."""
    older: Check | None = None
    """The check of the same parameter in earlier versions, under another name and in another unit."""
    bounds: Callable[[float], tuple[str, float]] | None = None
    """The key of the model that a value bounds, and the bound, airspeeds as reported; None if it bounds none."""
    asks: float | None = None
    """The nearest allowed value, to which it may be set on consent; None where only its owner can say."""
    old: bool = False
    """Whether only versions have it that are rare by now: it's asked for once the newer name isn't answered."""
    may_lack: bool = False
    """Whether versions that are flown lack it, together with what it is a parameter of."""

    def formerly(self, name: str, unit: float = 1.0) -> Check:
        """Return the check with the parameter's name in rare versions, and the unit that it had then."""
        bounds = self.bounds
        allowed = self.allowed if unit == 1.0 else f"{self.allowed} (this is in units of {unit:g})"
        older = Check(
            (name,),
            allowed,
            lambda value: self.holds(unit * value),
            lambda value: self.refuses(unit * value),
            bounds=None if bounds is None else lambda value: bounds(unit * value),
            asks=None if self.asks is None else self.asks / unit,
            old=True,
        )
        return replace(self, older=older)

    def bound(self, values: Mapping[str, float]) -> tuple[str, float, str] | None:
        """Return the key of the model that the parameter bounds, the bound, and the parameter in words.

        None if it is unknown, as its model needs it, or bounds none. A bound that leaves nothing to fly with is none.
        """
        name = next((name for name in self.names if name in values), None)
        if name is None:
            return None if self.older is None else self.older.bound(values)
        if self.bounds is None or self.holds(values[name]) or self._leaves_nothing(values[name]):
            return None
        return *self.bounds(values[name]), f"{name} {values[name]:g}"

    def _leaves_nothing(self, value: float) -> bool:
        """Return whether a value leaves the vehicle no speed, no turn or no climb at all."""
        return self.bounds is not None and not self.bounds(value)[1] > 0.0

    def change(self, values: Mapping[str, float]) -> tuple[str, float, float] | None:
        """Return the parameter's name, its value among `values`, and the one that is asked for; None if it is allowed.

        None also for what is unknown, and for what only its owner can set.
        """
        name = next((name for name in self.names if name in values), None)
        if name is None:
            return None if self.older is None else self.older.change(values)
        if self.asks is None or is_untouched(name) or self.holds(values[name]):
            return None
        return name, values[name], self.asks

    @property
    def all_names(self) -> tuple[str, ...]:
        """The parameter's names in all versions, newest first."""
        return self.names if self.older is None else (*self.names, *self.older.all_names)

    def finding(self, values: Mapping[str, float]) -> Finding | None:
        """Return the finding on the parameter among `values`; None if it is allowed, or unknown."""
        found = next(((name, values[name]) for name in self.names if name in values), None)
        if found is None:
            return None if self.older is None else self.older.finding(values)
        if self.holds(found[1]):
            return None
        refuses = self.refuses(found[1]) or self._leaves_nothing(found[1])
        return Finding(f"{found[0]}: found {found[1]:g}; allowed: {self.allowed}", refuses)


def only_read(name: str, *, may_lack: bool = False) -> Check:
    """Return the check of a parameter that is read for its value alone; `may_lack`: as of `Check`."""
    return Check((name,), "any", lambda _: True, may_lack=may_lack)


def climb_check(names: tuple[str, ...], model: VehicleModel, unit: str = "m/s", size: float = 1.0) -> Check:
    """Return the check that a vehicle climbs, or descends, as fast as its model says.

    Args:
        names: the parameter's, newest first.
        model: limits of its setpoints.
        unit: of its values.
        size: of this unit, m/s.
    """
    fastest = model.climb_max_mps
    return Check(
        names,
        f"{fastest / size:g} {unit} or more, its model's climb_max_mps; it changes its height no faster",
        lambda value: size * value >= fastest,
        bounds=lambda value: ("climb_max_mps", size * value),
        asks=fastest / size,
    )


def lowest_m(path: PathPlan) -> float:
    """Return the height of a path's lowest waypoint above the origin, m."""
    return min(height_m for _, _, height_m in path.waypoints_m)


def envelope_checks(
    model: VehicleModel,
    path: PathPlan,
    commanded_mps: float,
    minimum: str,
    maximum: str,
    trim: str,
    bank: str,
    beyond: tuple[str, str],
) -> list[Check]:
    """Return the checks that a fixed wing can fly the speeds and turns of its setpoints.

    Args:
        model: limits of its setpoints.
        path: the formation's path.
        commanded_mps: airspeed commanded for the path's true airspeed, m/s; it and the parameters are sensor readings.
        minimum: name of the parameter for the lowest airspeed, m/s.
        maximum: for the highest airspeed, m/s.
        trim: for the airspeed of level flight, m/s.
        bank: for the largest bank angle, degrees.
        beyond: how it treats setpoints below the lowest and above the highest airspeed.
    """
    slowest, fastest, speed = model.speed_min_mps, model.speed_max_mps, path.begin_mps
    cruises = f"{commanded_mps:.3g} m/s, what a calibrated sensor reads at path.speed_mps in the field's air"
    if abs(commanded_mps - speed) < SAME_MPS:
        cruises = f"{speed:g} m/s, path.speed_mps"
    bank_deg = math.degrees(math.atan(speed * model.turn_rate_max_rps / GRAVITY_MPS2))
    return [
        Check(
            (minimum,),
            f"up to {slowest:g} m/s, its model's speed_min_mps; slower setpoints are {beyond[0]}",
            lambda value: value <= slowest,
            lambda value: value > commanded_mps,
            bounds=lambda value: ("speed_min_mps", value),
            asks=slowest,
        ),
        Check(
            (maximum,),
            f"{fastest:g} m/s or more, its model's speed_max_mps; faster setpoints are {beyond[1]}",
            lambda value: value >= fastest,
            lambda value: value < commanded_mps,
            bounds=lambda value: ("speed_max_mps", value),
            asks=fastest,
        ),
        Check(
            (trim,),
            f"{cruises}, to which throttle and pitch are trimmed",
            lambda value: abs(value - commanded_mps) <= TRIM_OFF_MPS,
            asks=commanded_mps,
        ),
        Check(
            (bank,),
            f"{bank_deg:.0f} degrees or more, for its model's turn_rate_max_rps at {speed:g} m/s",
            lambda value: value >= round(bank_deg),
            bounds=lambda value: ("turn_rate_max_rps", math.tan(math.radians(value)) * GRAVITY_MPS2 / speed),
            asks=float(round(bank_deg)),
        ),
    ]


class ParameterReader:
    """Reads the parameters of one vehicle that its checks need."""

    def __init__(
        self, system: int, checks: Sequence[Check], value_of: Callable[[ParamValue], float] = attrgetter("param_value")
    ) -> None:
        """Prepare requests to `system`; `value_of` decodes an answer."""
        self._system, self._checks, self._value_of = system, checks, value_of
        self._tries = {name: 0 for check in checks for name in check.all_names}
        self._values: dict[str, float] = {}
        self._kinds: dict[str, int] = {}
        self._next = Instant(0)

    @property
    def complete(self) -> bool:
        """Whether every parameter has been read, or all attempts have failed."""
        return not self._missing()

    def requests(self, now: Instant) -> list[ParamRequestRead]:
        """Return the requests to send now: those with the fewest attempts first."""
        missing = sorted(self._missing(), key=self._tries.__getitem__)[:AT_ONCE]
        if not missing or now < self._next:
            return []
        self._next = after(now, RETRY_S)
        for name in missing:
            self._tries[name] += 1
        return [ParamRequestRead(self._system, m.MAV_COMP_ID_AUTOPILOT1, name) for name in missing]

    def receive_parameter(self, message: ParamValue, now: Instant) -> None:
        """Take a parameter; ones not requested or not finite are ignored. Names not yet tried are requested at once."""
        if message.param_id not in self._tries:
            return
        value = self._value_of(message)
        if not math.isfinite(value):
            return
        self._values[message.param_id] = value
        self._kinds[message.param_id] = message.param_type
        if not any(self._tries[name] for name in self._missing()):
            self._next = now

    @property
    def values(self) -> Mapping[str, float]:
        """What has been read, by name."""
        return self._values

    def bounds(self) -> list[tuple[str, float, str]]:
        """Return the model's keys that parameters bound further, the bounds, and the parameters in words."""
        return [bound for check in self._checks if (bound := check.bound(self._values)) is not None]

    def changes(self) -> list[Change]:
        """Return what would have to be set so that all is allowed, as far as that may be set."""
        asked = (change for check in self._checks if (change := check.change(self._values)) is not None)
        return [Change(name, self._kinds[name], before, after_) for name, before, after_ in asked]

    def findings(self) -> list[Finding]:
        """Return what isn't allowed, and what could not be read."""
        found = [finding for check in self._checks if (finding := check.finding(self._values)) is not None]
        awaited = (check for check in self._checks if not check.may_lack)
        unread = [" or ".join(check.all_names) for check in awaited if not self._reported(check)]
        return [*found, *([Finding(f"no answer for {', '.join(unread)}, not checked")] if unread else [])]

    def _missing(self) -> list[str]:
        wanted = [name for check in self._checks if not self._reported(check) for name in self._names(check)]
        return [name for name in wanted if self._tries[name] < TRIES]

    def _names(self, check: Check) -> tuple[str, ...]:
        """Return the names to ask for now."""
        rare = check.older is not None and check.older.old
        return check.names if rare and self._tries[check.names[-1]] < TRIES_BEFORE_OLD else check.all_names

    def _reported(self, check: Check) -> bool:
        return any(name in self._values for name in check.all_names)
