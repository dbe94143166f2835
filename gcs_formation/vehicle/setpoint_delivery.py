"""Which messages of one vehicle's setpoints are sent: those with news, those due again, and nothing else."""

from __future__ import annotations

import math
from typing import Final

from airlink.clock import LONG_AGO, Instant, seconds_between
from airlink.messages import Message
from airlink.messages.command import CommandInt
from flight_model.autopilot_model import within, wrap
from flight_model.flight_state import FlightState, Setpoint
from gcs_formation.vehicle.autopilot_family import Autopilot
from gcs_formation.vehicle.command_delivery import REPEAT_S, SetpointChannel
from gcs_formation.vehicle.held_setpoint import HeldSetpoint, Which
from gcs_formation.vehicle.velocity_setpoint import is_same

LOSSY_S: Final = 10.0
"""Time after a loss for which a link counts as lossy."""
EVERYTHING: Final = 0.0
"""Multiple of the tolerances of news with which every change is sent, as over a link that loses the next one, too."""
EVERY: Final = True, True, True
"""All quantities: over a link that loses they go with each one that is news, and make up for what was lost."""
GOLDEN: Final = (math.sqrt(5.0) - 1.0) / 2.0
QUANTITIES: Final = 3
ALL_AGAIN_S: Final = QUANTITIES * REPEAT_S
"""Time after which every quantity is repeated."""
MAX_LEAD_RAD: Final = 0.03
SLACK_S: Final = 0.01
"""Ticks come a little early or late."""
STREAM_LOSSES: Final = 5.0
"""A stream of setpoints, whose lack is a failsafe's reason, is repeated this often within the failsafe's time."""


class SetpointDelivery:
    """What one vehicle is sent of its setpoints, and what it holds."""

    def __init__(self, autopilot: Autopilot, gap_s: float) -> None:
        """Start with nothing sent; acknowledgements may come `gap_s` late."""
        self._autopilot = autopilot
        channels = {command: SetpointChannel(command, gap_s) for command in autopilot.setpoint_commands}
        self.channels = [channels[command] for command in autopilot.setpoint_commands]
        """The channels of airspeed, heading and height, which may be one; empty if setpoints aren't acknowledged."""
        self.held = HeldSetpoint()
        self.tolerance = 1.0
        """Multiple of the tolerances of news."""
        self.hurries = False
        """Whether every change is sent on its tick, as while any vehicle manoeuvres."""
        self.interval_s, self.spares = 0.0, False
        """Shortest time between two setpoints of a quantity, and whether bytes are spared, as of a full link."""
        self._at, self._heading_rad = LONG_AGO, math.nan
        """When the last setpoint was wanted, and its heading."""
        self.turn = 0
        """The vehicle's number among those that take turns."""
        self.lost_at = Instant(0)
        """When a frame of the vehicle or an answer was last missing."""
        self._streamed, self._streamed_at = list[Message](), LONG_AGO
        """The messages of the last setpoint, for a family that acknowledges none, and when they were sent."""

    def messages(
        self, setpoint: Setpoint, where: FlightState, at: Instant, round_trip_s: float, hovers_after_s: float
    ) -> list[Message]:
        """Return the messages of a setpoint to send at an instant over a link with this round trip.

        `where` is the vehicle's state when the setpoint takes effect; `hovers_after_s`: its failsafe's time.
        """
        for each in self.channels:
            if each.overdue(at):
                self.lost_at = at
        loses = self.loses(at)
        everything = (loses or self.hurries) and not self.spares
        tolerance = EVERYTHING if everything else self.tolerance
        if self.interval_s > 0.0:
            setpoint = self._led(setpoint, at)
        wanted = setpoint.speed_mps, setpoint.heading_rad, setpoint.height_m
        if not self.channels:
            messages, holds = self._stream(
                setpoint, where, at, min(REPEAT_S, hovers_after_s / STREAM_LOSSES), tolerance, loses=loses
            )
            if holds:
                self.held.send(wanted, wanted, (True, True, True))
            return messages
        if tolerance > 0.0:
            height_m = self.held.height_ahead_m(setpoint.height_m, at)
            setpoint = Setpoint(setpoint.speed_mps, setpoint.heading_rad, height_m)
            wanted = setpoint.speed_mps, setpoint.heading_rad, height_m
        encoded = self._autopilot.quantities(setpoint, where)
        news = self.held.news(encoded, at, tolerance, self._autopilot.prompt_share)
        which = EVERY if everything and loses and any(news) else self._which(news, at, loses=loses)
        if not (which[0] or which[1] or which[2]):
            self._autopilot.keep_setpoint()
            return []
        self.held.send(wanted, encoded, which)
        known = [None if due else each.held for due, each in zip(which, self.channels, strict=True)]
        messages = self._autopilot.changed(setpoint, where, known)
        for message in messages:
            if isinstance(message, CommandInt):
                self._sent(message, news, at, round_trip_s)
        return messages

    def loses(self, at: Instant) -> bool:
        """Return whether the link counts as lossy at an instant."""
        return seconds_between(self.lost_at, at) < LOSSY_S

    def invalidate(self) -> None:
        """Send the next setpoint in full: the vehicle may have received others meanwhile."""
        self.held.invalidate()
        self._streamed = []
        for channel in self.channels:
            channel.invalidate()

    def channel(self, command: int) -> SetpointChannel | None:
        """Return the channel of a command, None if it carries no setpoint."""
        for each in self.channels:
            if each.command == command:
                return each
        return None

    def _which(self, news: Which, at: Instant, *, loses: bool) -> Which:
        """Return which quantities to send: those with news, and those due again; all where one command carries them."""
        speed, heading, height = self.channels
        again = (
            self._again(speed, at, loses=loses),
            self._again(heading, at, loses=loses),
            self._again(height, at, loses=loses),
        )
        if self.interval_s > 0.0:
            news = (
                news[0] and self._may(0, at),
                news[1] and self._may(1, at),
                news[2] and self._may(2, at),
            )
        which = news[0] or again[0], news[1] or again[1], news[2] or again[2]
        together = speed is heading and (which[0] or which[1] or which[2])
        return (True, True, True) if together else which

    def _again(self, channel: SetpointChannel, at: Instant, *, loses: bool) -> bool:
        """Return whether a quantity is due again though it isn't news.

        Each `REPEAT_S` without any message one quantity is repeated, that which was sent first, and each is repeated
        after `ALL_AGAIN_S` at the latest; over a link that loses, each after `REPEAT_S`.
        """
        repeat_s = REPEAT_S
        if not loses:
            ages_s = [each.age_s(at) for each in self.channels]
            quiet = min(ages_s) >= REPEAT_S and channel is self.channels[ages_s.index(max(ages_s))]
            repeat_s = REPEAT_S if quiet else ALL_AGAIN_S
        return channel.is_due(at, loses=loses, spares=self.spares, repeat_s=repeat_s)

    def _led(self, setpoint: Setpoint, at: Instant) -> Setpoint:
        """Return a setpoint whose heading is that of the middle of the time for which it will be held.

        Held for several ticks, headings in a turn would be late by half of that time less a tick's, and errors across
        would add up.
        """
        elapsed_s, turned_rad = seconds_between(self._at, at), wrap(setpoint.heading_rad - self._heading_rad)
        self._at, self._heading_rad = at, setpoint.heading_rad
        if not 0.0 < elapsed_s < self.interval_s or math.isnan(turned_rad):
            return setpoint
        lead_rad = (self.interval_s - elapsed_s) / 2.0 / elapsed_s * turned_rad
        heading_rad = setpoint.heading_rad + within(lead_rad, -MAX_LEAD_RAD, MAX_LEAD_RAD)
        return Setpoint(setpoint.speed_mps, heading_rad, setpoint.height_m)

    def _may(self, quantity: int, at: Instant) -> bool:
        """Return whether it is a quantity's turn again: those of all vehicles take turns, as a queue is short."""
        since_s = seconds_between(Instant(0), at) / self.interval_s + GOLDEN * (QUANTITIES * self.turn + quantity)
        return math.floor(since_s) > math.floor(max(0.0, since_s - self.channels[quantity].age_s(at) / self.interval_s))

    def _sent(self, message: CommandInt, news: Which, at: Instant, round_trip_s: float) -> None:
        is_news, channel = False, self.channel(message.command)
        for quantity, each in zip(news, self.channels, strict=True):
            is_news = is_news or (quantity and each is channel)
        if channel is not None:
            channel.sent(message, at, round_trip_s, news=is_news)

    def _stream(
        self, setpoint: Setpoint, where: FlightState, at: Instant, again_s: float, tolerance: float, *, loses: bool
    ) -> tuple[list[Message], bool]:
        """Return the messages of a setpoint that isn't acknowledged, if they say anything new or are due again.

        And whether the vehicle holds it from then on: what says the same is held as well as what is sent.
        """
        messages, age_s = list(self._autopilot.setpoint(setpoint, where)), seconds_between(self._streamed_at, at)
        same = len(messages) == len(self._streamed)
        for message, held in zip(messages, self._streamed, strict=False):
            same = same and is_same(message, held, tolerance)
        early = bool(self._streamed) and age_s < self.interval_s - SLACK_S
        if (same or early) and age_s < again_s and not (loses and not self.spares):
            return [], same
        self._streamed, self._streamed_at = messages, at
        return messages, True
