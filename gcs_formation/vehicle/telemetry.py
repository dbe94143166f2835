"""The newest telemetry of one vehicle."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Final

from airlink import mavlink as m
from airlink.messages import Message
from airlink.messages.system import Heartbeat, Statustext
from airlink.messages.telemetry import (
    Attitude,
    BatteryStatus,
    EkfStatusReport,
    EstimatorStatus,
    ExtendedSysState,
    GlobalPositionInt,
    GpsRawInt,
    HomePosition,
    SysStatus,
    VfrHud,
)
from flight_model.earth import GeodeticOrigin
from gcs_formation.vehicle.plausible_messages import (
    INFINITE,
    SPEED_LIMIT_MPS,
    TURN_RAD,
    first_impossible,
    first_not_finite,
    is_attitude,
    is_position,
    plausible_home,
    usable_of,
    why_no_position,
)
from gcs_formation.vehicle.reported_battery import ReportedBattery
from gcs_formation.vehicle.reported_motion import ReportedMotion
from gcs_formation.vehicle.reporting import Reporting

AIRBORNE_M: Final = 10.0
"""Height above home from which an armed vehicle counts as flying, whatever it reports."""
ACTIVE: Final = m.MAV_STATE_ACTIVE
FLIGHT_STATUSES: Final = (m.MAV_STATE_STANDBY, ACTIVE)
BOOTING: Final = (m.MAV_STATE_BOOT, m.MAV_STATE_CALIBRATING)
KEPT_TEXTS: Final = 8
TEXT_BYTES: Final = 50
"""Length of STATUSTEXT's field: a text that fills it is continued in another message with its id."""
NO_CHUNKS: Final = (0, "", 0)
ALONE: Final = 5
ALONE_S: Final = 1.5
"""An airspeed or attitude is flown without after so many positions alone, over this time, s."""
ALONE_ATTITUDES: Final = 8
ALONE_ATTITUDES_S: Final = 1.2
"""A position isn't reported any more after so many attitudes alone, over this time, s; one that can't be, or isn't
filled, after `ALONE` of these in a row."""
MAX_STAMP_DIFFERENCE_S: Final = 2.0
"""Largest difference of stamps between a position and the attitude and airspeed paired with it, s."""


@dataclass
class Telemetry:
    """The newest value of each message."""

    origin: GeodeticOrigin
    hovers: bool = False
    """Whether the vehicle is a multirotor."""
    motion: ReportedMotion | None = None
    displaced_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """What is added to every position reported, north, east and up: its telemetry was found to have jumped."""
    attitude: Attitude | None = None
    airspeed_mps: float = math.nan
    airspeed_stamp_s: float = math.nan
    """Stamp of the newest position when the airspeed arrived: VFR_HUD has no stamp."""
    hud_heading_rad: float = math.nan
    """Heading of the newest VFR_HUD."""
    heartbeat: Heartbeat | None = None
    heartbeats: int = 0
    armed: bool = False
    """Whether the motors are armed."""
    custom_mode: int | None = None
    """The autopilot's own mode number, None before the first heartbeat."""
    flight_status: int = m.MAV_STATE_UNINIT
    """Last STANDBY or ACTIVE, by which ArduPilot reports whether it flies; CRITICAL and EMERGENCY don't tell."""
    ekf_flags: int = 0
    estimator_reports: int = 0
    """Number of reports of its estimator."""
    estimator_ratios: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Of the newest: innovations of velocity, position and height, as shares of their gates."""
    fix: tuple[int, int] = (0, 0)
    """Kind of the receiver's fix, and number of satellites, where it tells them."""
    unfixed: bool = False
    """Whether positions come, but without a fix."""
    sensors_healthy: int = 0
    battery: ReportedBattery = field(default_factory=ReportedBattery)
    landed_state: int = m.MAV_LANDED_STATE_UNDEFINED
    home_m: tuple[float, float] | None = None
    """Its home north and east of the origin, m; None while unknown."""
    home_height_m: float = math.nan
    """Height of its home above the origin by HOME_POSITION, m; NaN while unknown."""
    position_refused: str = ""
    """Why no position has been taken yet, where one was reported: the field's name and value."""
    implausible: int = 0
    """Messages dropped because an aircraft can't have sent such values."""
    not_finite: str = ""
    """Name and value of the first field that isn't finite in the newest attitude, empty if all are."""
    _refused_positions: int = 0
    """Positions in a row that can't be, or aren't filled, since the last."""
    _positions: Reporting = field(default_factory=lambda: Reporting(ALONE_ATTITUDES, ALONE_ATTITUDES_S))
    """Compared with attitudes; the next two with positions."""
    _attitudes: Reporting = field(default_factory=lambda: Reporting(ALONE, ALONE_S))
    _airspeeds: Reporting = field(default_factory=lambda: Reporting(ALONE, ALONE_S))
    texts: deque[str] = field(default_factory=lambda: deque[str](maxlen=KEPT_TEXTS))
    texts_reported: int = 0
    """Number of complete texts received."""
    _chunks: tuple[int, str, int] = NO_CHUNKS
    """Id of an incomplete text, what has come of it, and the number of its next chunk."""

    def store(self, message: Message) -> None:
        """Store the state in `message`; values that are infinite or implausible are dropped and counted."""
        if isinstance(message, Attitude):
            self.take_attitude(message)
        elif isinstance(message, VfrHud):
            self.take_airspeed(message)
        elif isinstance(message, Heartbeat):
            self.take_heartbeat(message)
        elif isinstance(message, GlobalPositionInt):
            self.take_position(message)
        elif isinstance(message, EkfStatusReport):
            self.ekf_flags = message.flags
            self.estimator_reports += 1
            self.estimator_ratios = message.velocity_variance, message.pos_horiz_variance, message.pos_vert_variance
        elif isinstance(message, EstimatorStatus):
            self.ekf_flags = message.flags
            self.estimator_reports += 1
            self.estimator_ratios = message.vel_ratio, message.pos_horiz_ratio, message.pos_vert_ratio
        elif isinstance(message, (SysStatus, BatteryStatus)):
            self._take_status(message)
        elif isinstance(message, ExtendedSysState):
            self.landed_state = message.landed_state
        elif isinstance(message, HomePosition):
            self._take_home(message)
        elif isinstance(message, Statustext):
            self.take_text(message)
        elif isinstance(message, GpsRawInt):
            self.fix = message.fix_type, message.satellites_visible

    def _take_status(self, message: SysStatus | BatteryStatus) -> None:
        """Store which sensors are healthy, and the battery."""
        if isinstance(message, SysStatus):
            self.sensors_healthy = message.onboard_control_sensors_health
        self.battery.take(message)

    def take_heartbeat(self, message: Heartbeat) -> None:
        """Store whether the vehicle is armed, and its mode."""
        self.heartbeat = message
        self.heartbeats += 1
        self.armed = bool(message.base_mode & m.MAV_MODE_FLAG_SAFETY_ARMED)
        self.custom_mode = message.custom_mode
        if message.system_status in FLIGHT_STATUSES:
            self.flight_status = message.system_status

    def take_position(self, message: GlobalPositionInt) -> None:
        """Store a position; an autopilot without a fix reports latitude and longitude 0."""
        if not is_position(message):
            no_fix_yet = message.lat_rad == message.lon_rad == 0.0 and self.motion is None
            self.implausible += not no_fix_yet
            if self.motion is None:
                self.position_refused = why_no_position(message)
            self._refused_positions += 1
            self.unfixed = self.unfixed or no_fix_yet
            return
        self.unfixed = False
        north_m, east_m, down_m = self.origin.to_ned(message.lat_rad, message.lon_rad, message.alt_m)
        stamp_s = message.time_boot_s
        self._refused_positions = 0
        self._positions.take(stamp_s)
        self._airspeeds.others += 1
        self._attitudes.others += 1
        if (self._airspeeds.others > ALONE or self._attitudes.others > ALONE) and self.complete:
            self._fly_without(stamp_s)
        north_more_m, east_more_m, up_m = self.displaced_m
        self.motion = ReportedMotion(
            stamp_s,
            north_m + north_more_m,
            east_m + east_more_m,
            up_m - down_m,
            message.vx_mps,
            message.vy_mps,
            -message.vz_mps,
            message.relative_alt_m + up_m,
        )
        self.motion.heading_rad = message.hdg_rad if message.hdg_rad < TURN_RAD else math.nan
        if math.isnan(self.airspeed_stamp_s):
            self.airspeed_stamp_s = stamp_s

    def _take_home(self, message: HomePosition) -> None:
        """Store a home; before the first position, latitude and longitude 0 are an autopilot without a fix."""
        home = plausible_home(message, self.origin)
        if home is None:
            self.implausible += self.motion is not None or message.latitude_rad != 0.0 or message.longitude_rad != 0.0
            return
        north_m, east_m, self.home_height_m = home
        self.home_m = north_m, east_m

    def separation_m(self, message: GlobalPositionInt) -> float:
        """Return how far a reported position is from the newest one, carried by its velocity; NaN if none is known."""
        motion = self.motion
        if motion is None or not is_position(message):
            return math.nan
        north_m, east_m, down_m = self.origin.to_ned(message.lat_rad, message.lon_rad, message.alt_m)
        north_more_m, east_more_m, up_m = self.displaced_m
        later_s = message.time_boot_s - motion.stamp_s
        return math.hypot(
            north_m + north_more_m - motion.north_m - motion.north_mps * later_s,
            east_m + east_more_m - motion.east_m - motion.east_mps * later_s,
            up_m - down_m - motion.height_m - motion.climb_mps * later_s,
        )

    def _fly_without(self, stamp_s: float) -> None:
        """Replace an airspeed or attitude that isn't reported: no airspeed is a reading of 0, as in VFR_HUD."""
        if not self.hovers and self._airspeeds.lacks(stamp_s):
            self.airspeed_mps, self.airspeed_stamp_s = 0.0, stamp_s
        known = self._airspeeds.others <= ALONE and abs(self.hud_heading_rad) < INFINITE
        if known and self._attitudes.lacks(stamp_s):
            self.attitude = Attitude(stamp_s, 0.0, 0.0, self.hud_heading_rad, 0.0, 0.0, 0.0)

    def take_attitude(self, message: Attitude) -> None:
        """Store an attitude; of one that isn't finite what can be used, with VFR_HUD's heading in place of its yaw."""
        self._positions.others += 1
        if is_attitude(message):
            self.attitude, self.not_finite = message, ""
            self._attitudes.take(message.time_boot_s)
            return
        self.implausible += 1
        self.not_finite = first_not_finite(message) or first_impossible(message)
        usable = usable_of(message, self.hud_heading_rad)
        if usable is not None:
            self.attitude = usable
            self._attitudes.take(message.time_boot_s)

    def take_airspeed(self, message: VfrHud) -> None:
        """Store an airspeed; a multirotor without a sensor gets its ground speed instead.

        A fixed wing that has reported an airspeed and then reports none has a reading of 0, which no flight explains.
        """
        self.hud_heading_rad = message.heading_rad
        unmeasured = self.hovers and math.isnan(message.airspeed_mps)
        speed_mps = message.groundspeed_mps if unmeasured else message.airspeed_mps
        if math.isnan(speed_mps) and abs(self.airspeed_mps) < INFINITE:
            self.implausible += 1
            speed_mps = 0.0
        if 0.0 <= speed_mps <= SPEED_LIMIT_MPS:
            self.airspeed_mps = speed_mps
            self.airspeed_stamp_s = self.motion.stamp_s if self.motion else math.nan
            self._airspeeds.take(self.airspeed_stamp_s)
        else:
            self.implausible += 1

    def take_text(self, message: Statustext) -> None:
        """Store a text once its last chunk has arrived: the one that doesn't fill its field.

        What has come of a text is dropped where a chunk of it is missing. A field of one byte numbers the chunks, so
        there are 256 at most.
        """
        number, begun, following = self._chunks
        goes_on = message.id and message.id == number and message.chunk_seq == following
        text = (begun if goes_on else "") + message.text
        if message.id and len(message.text.encode()) >= TEXT_BYTES:
            self._chunks = message.id, text, message.chunk_seq + 1
            return
        self._chunks = NO_CHUNKS
        self.texts.append(_printable(text.strip()))
        self.texts_reported += 1

    def invalidate(self) -> None:
        """Forget everything that a restart invalidates."""
        self.displaced_m = (0.0, 0.0, 0.0)
        self.motion = self.attitude = self.heartbeat = self.custom_mode = None
        self.armed, self.flight_status = False, m.MAV_STATE_UNINIT
        self.airspeed_mps = self.airspeed_stamp_s = self.hud_heading_rad = math.nan
        self.ekf_flags = self.sensors_healthy = 0
        self.estimator_ratios, self.battery = (0.0, 0.0, 0.0), ReportedBattery()
        self.landed_state, self.home_m = m.MAV_LANDED_STATE_UNDEFINED, None
        self.home_height_m, self.position_refused = math.nan, ""
        for each in (self._positions, self._attitudes, self._airspeeds):
            each.begin()

    @property
    def boots(self) -> bool:
        """Whether its last heartbeat shows an autopilot still starting, whose mode is no pilot's choice."""
        status = ACTIVE if self.heartbeat is None else self.heartbeat.system_status
        return status in BOOTING or (status == m.MAV_STATE_UNINIT and not self.armed)

    def progress(self) -> tuple[object, ...]:
        """Return what changes as the vehicle gets ready."""
        return self.ekf_flags, self.sensors_healthy, self.fix, self.motion is None, self.attitude is None

    @property
    def last_words(self) -> str:
        """Its last text as the end of a sentence; empty if there is none."""
        return f"; it said: '{self.texts[-1]}'" if self.texts else ""

    @property
    def complete(self) -> bool:
        """Whether everything that the control law needs has arrived."""
        return self.motion is not None and self.attitude is not None and abs(self.airspeed_mps) < INFINITE

    @property
    def aloft(self) -> bool:
        """Whether its position is well above its home."""
        return self.motion is not None and self.motion.above_home_m > AIRBORNE_M

    @property
    def lacking(self) -> str:
        """Which quantity isn't reported while the others are: position, attitude or airspeed; empty if all are."""
        position_s = math.nan if self.motion is None else self.motion.stamp_s
        if self._positions.lacks(self._attitudes.stamp_s):
            return "position"
        if self._refused_positions > ALONE and self.motion is not None:
            return "position"
        if self._attitudes.lacks(position_s):
            return "attitude"
        return "airspeed" if not self.hovers and self._airspeeds.lacks(position_s) else ""

    @property
    def of_one_time(self) -> bool:
        """Whether attitude and airspeed were taken near the position's time; an airspeed of unknown time passes."""
        motion, attitude = self.motion, self.attitude
        if motion is None or attitude is None or abs(motion.stamp_s - attitude.time_boot_s) > MAX_STAMP_DIFFERENCE_S:
            return False
        return not motion.stamp_s - self.airspeed_stamp_s > MAX_STAMP_DIFFERENCE_S


def _printable(text: str) -> str:
    """Return the text with control characters replaced."""
    return "".join(letter if letter.isprintable() else "\N{REPLACEMENT CHARACTER}" for letter in text)
