"""All state of one vehicle in the station: its links, telemetry, commands, start-up, and what these tell of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink import mavlink as m
from airlink.clock import LONG_AGO, Instant
from airlink.endpoint import Address, VehicleId
from airlink.messages import KINDS
from gcs_formation.estimation.airspeed import AirspeedCheck
from gcs_formation.link.clock_by_command import ClockByCommand
from gcs_formation.link.clock_sync import ClockSync
from gcs_formation.link.frame_history import FrameHistory
from gcs_formation.link.frame_loss import SequenceTracker
from gcs_formation.link.jitter import JitterMeter
from gcs_formation.link.link_health import Connection, LinkState
from gcs_formation.link.round_trips import RoundTrips
from gcs_formation.link.source_binding import SourceBinding
from gcs_formation.link.vehicle_links import Link, Links, links_by
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.command_delivery import (
    GAP_S,
    CommandQueue,
    EffectWatch,
    Outcome,
    SetpointChannel,
)
from gcs_formation.vehicle.member import CIRCLING, Member
from gcs_formation.vehicle.pilots_choice import PilotsChoice
from gcs_formation.vehicle.sampler import Sampler
from gcs_formation.vehicle.setpoint_delivery import SetpointDelivery
from gcs_formation.vehicle.startup import StartUp, TakeOff
from gcs_formation.vehicle.startup_step import StartUpStep
from gcs_formation.vehicle.telemetry import Telemetry

UNANSWERED_S: Final = 1.5
"""Longest time without an answer from a vehicle that receives the ground station."""
UNANSWERED_PROBES: Final = 3.0
"""More of it, in periods of TIMESYNC requests that a full link makes rarer."""


class SendingLimits:
    """What a full link leaves to a vehicle."""

    def __init__(self) -> None:
        """Start without any."""
        self.probe_s = 0.0
        """Shortest time between two TIMESYNC requests."""
        self.full = ""
        """What shows that its link is full, in words; empty if nothing does."""


class VehicleState:
    """All state of one vehicle.

    Where it is received, and what is measured there, is that of the link in use; while a frame is taken, of the link on
    which it came.
    """

    connection: Connection
    round_trips: RoundTrips
    clock: ClockSync
    source_binding: SourceBinding
    """Decides which of several senders with its id is the vehicle."""
    history: FrameHistory
    """Tells its news from copies and late frames."""
    jitter: JitterMeter
    sequence: SequenceTracker

    frames_lost_at: Instant = LONG_AGO
    """When frames of it were last missing."""
    holds_from: Instant = LONG_AGO
    """When it was last commanded to loiter while the others fly on."""

    def __init__(
        self,
        identity: VehicleId,
        index: int,
        autopilot: Autopilot,
        connection: Connection | Sequence[Connection],
        telemetry_rate_hz: float,
        *,
        by_utc: bool = False,
        airspeed_check: AirspeedCheck | None = None,
        setpoint_gap_s: float = GAP_S,
    ) -> None:
        """Start with a vehicle not received yet; `by_utc`: its stamps are mapped by UTC once that is known.

        An `airspeed_check` decides whether a fixed wing's airspeeds are plausible. Acknowledgements of setpoints may
        come `setpoint_gap_s` late. Of several connections each is a link of its own.
        """
        self.identity, self.index, self.autopilot = identity, index, autopilot
        """Its id, and its index in every list of a tick."""
        connections = [connection] if isinstance(connection, Connection) else connection
        self.each_link = links_by(connections, autopilot.loop_s, by_utc=by_utc)
        self.links = Links(self.each_link) if len(self.each_link) > 1 else None
        """Which of them is in use; None if it has but one."""
        self._see(self.each_link[0])
        self.setpoints, self.limits, self.commands = (
            SetpointDelivery(autopilot, setpoint_gap_s),
            SendingLimits(),
            CommandQueue(),
        )
        self.hovers_after_s, self.returns_after_s = autopilot.hovers_after_s, autopilot.returns_after_s
        """Defaults of its autopilot family."""
        self.telemetry = Telemetry(autopilot.origin, autopilot.hovers)
        self.sampler = Sampler(self.telemetry, autopilot, self.round_trips, self.source_binding, airspeed_check)
        """Turns its telemetry into samples of its present state."""
        self.messages_in = vec[i64]([0] * len(KINDS))
        """Number of messages received of each kind, indexed by `kind.index`."""
        self.unknown_in: dict[int, int] = {}  # number of messages of other kinds, by their ids
        self.start_up_hz = self.rates_hz = dict(autopilot.rates_hz(telemetry_rate_hz, utc=by_utc))
        """Rates of messages, Hz: those that its start-up asks for, or that come without a request, and those now."""
        self._at_last: tuple[StartUpStep, ...] = ()
        """Steps after those of its autopilot in each start-up."""
        self.start_up = self._started_afresh()
        # holds_at_m: the height at which it was last commanded to loiter while the others fly on; unfit: why its
        # telemetry can't be flown by in the formation, sent_home: why it is to fly home while they fly on, or empty
        self.member, self.holds_at_m, self.unfit, self.sent_home = Member.STARTING, math.nan, "", ""
        self.member_since = LONG_AGO
        self.bytes_in, self.bytes_out, self._by_command = 0, 0, ClockByCommand()
        self.effects, self.pilots_choice, self.take_off = EffectWatch(), PilotsChoice(), TakeOff()
        self.restarts, self._flew_before = 0, False
        """Number of restarts of its clock; whether it may have been flying at the last one."""
        self.alone_at = LONG_AGO
        """When its failsafe last had reason to act, by the lack of setpoints, heartbeats or a link."""

    @property
    def setpoint_channels(self) -> list[SetpointChannel]:
        """The channels of airspeed, heading and height, which may be one; empty if setpoints aren't acknowledged."""
        return self.setpoints.channels

    @property
    def follows_setpoints(self) -> bool:
        """Whether it is ready, in the mode in which it follows setpoints, and no pilot has chosen another mode."""
        ready = self.start_up.finished and self.pilots_choice.mode is None
        return ready and self.autopilot.takes_setpoints(self.telemetry)

    def see(self, link: Link) -> None:
        """See it by one of its links: the one on which a frame came, or the one in use."""
        if link.connection is not self.connection:
            self._see(link)
            self.sampler.see(link.round_trips, link.source_binding)

    def _see(self, link: Link) -> None:
        self.connection, self.round_trips, self.clock = link.connection, link.round_trips, link.clock
        self.source_binding, self.history = link.source_binding, link.history
        self.jitter, self.sequence = link.jitter, link.sequence

    def try_port(self, socket: int, peer: Address, now: Instant) -> Links:
        """Try a link that isn't named; what comes there isn't taken before it has been shown to be the vehicle's."""
        if self.links is None:
            self.links = Links(self.each_link)
        self.links.try_port(socket, peer, now)
        return self.links

    def drop_port(self, link: Link) -> None:
        """Drop a link that was tried: it isn't the vehicle's."""
        self.each_link.remove(link)
        if len(self.each_link) == 1:
            self.links = None

    @property
    def frames_in(self) -> int:
        """Number of frames received from it."""
        return sum([int(each.sequence.received + each.sequence.repeated) for each in self.each_link])

    @property
    def frames_out(self) -> int:
        """Number of frames sent to it."""
        return sum([each.frames_out for each in self.each_link])

    @property
    def is_left(self) -> bool:
        """Whether it was left to its pilot, who hasn't handed it back yet."""
        return self.start_up.left and not self.start_up.finished

    @property
    def awaited(self) -> bool:
        """Whether the formation waits for it before it begins.

        Not once it was given up, while its pilot has it, or while its link is lost after it had got ready.
        """
        ready = self.start_up.finished
        out = self.connection.state is LinkState.LOST if ready else self.start_up.abandoned
        return not out and self.member is not Member.PARTED

    @property
    def unanswered_s(self) -> float:
        """Time from its newest answer to its last frame, s."""
        return self.round_trips.unanswered_s(self.connection.last_received)

    @property
    def receives(self) -> bool:
        """Whether it answers as often as it must if it receives the ground station; rarer requests are allowed for."""
        return self.unanswered_s <= UNANSWERED_S + UNANSWERED_PROBES * self.limits.probe_s

    @property
    def flies_on(self) -> bool:
        """Whether it flies in its guided mode, which isn't the mode in which it loiters."""
        autopilot = self.autopilot
        guided = self.telemetry.custom_mode == autopilot.guided_mode != autopilot.loiter_mode
        return self.airborne and guided

    @property
    def airborne(self) -> bool:
        """Whether it flies, by its last telemetry; False after its link is lost."""
        return self.connection.state is not LinkState.LOST and self.flew

    @property
    def flew(self) -> bool:
        """Whether it was flying when last received."""
        return self.autopilot.is_airborne(self.telemetry)

    @property
    def may_fly(self) -> bool:
        """Whether it isn't known to be on the ground.

        It flies; or it flew before a restart and hasn't reported since that it is grounded; or it is armed and doesn't
        report whether it flies; or it is above the ground without a heartbeat.
        """
        seen, autopilot = self.telemetry, self.autopilot
        if autopilot.is_airborne(seen) or autopilot.is_grounded(seen):
            return autopilot.is_airborne(seen)
        return self._flew_before or seen.aloft or (seen.armed and not autopilot.says_grounded(seen))

    @property
    def refusal(self) -> str:
        """The command under insistence that it refuses, with its answer; empty if there is none."""
        asked, answer = self.commands.under_way, self.commands.refused_with
        if asked is None or answer is None:
            return ""
        effect, name = self.autopilot.effect(asked), m.name_of("MAV_CMD", asked.command)
        result = f"{name}: {m.name_of('MAV_RESULT', answer)}"
        return result if effect is None else f"{effect.description} ({result})"

    @property
    def circles(self) -> bool:
        """Whether its mode is one in which it circles, or may be by its last command."""
        if self.telemetry.custom_mode == self.autopilot.circling_mode:
            return True
        return self.autopilot.circling_mode >= 0 and (self.member in CIRCLING or self.may_loiter)

    @property
    def may_loiter(self) -> bool:
        """Whether a vehicle that flies in the formation may still obey an earlier command to loiter.

        This holds until it acknowledges the mode in which it follows setpoints.
        """
        waiting = self.commands.insists and self.commands.outcome is Outcome.WAITING
        return waiting and self.member is Member.FLYING

    @property
    def flies_home_m(self) -> tuple[float, float] | None:
        """North and east of its home, m, if it is in the mode in which it flies there; None if not, or if unknown."""
        return self.telemetry.home_m if self.telemetry.custom_mode == self.autopilot.home_mode else None

    @property
    def home_unreported(self) -> bool:
        """Whether it has been armed for this flight but hasn't reported its home."""
        return self.member is not Member.STARTING and self.telemetry.armed and self.telemetry.home_m is None

    def _started_afresh(self) -> StartUp:
        return StartUp((*self.autopilot.start_up(self.start_up_hz), *self._at_last), self.autopilot.start_up_modes)
