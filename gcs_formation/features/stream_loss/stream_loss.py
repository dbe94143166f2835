# Compiled by mypyc: it runs every tick.

"""A vehicle's loss where a router passes some kinds of messages only: by what its requested streams lack.

Sequence numbers count every frame that a vehicle sends. A router that filters kinds of messages takes frames out, so
that by the numbers alone four fifths may be lost of a link on which nothing is. A requested stream, which comes at a
known rate, lacks only what was lost. But its rate may be changed by others, and it can't tell a loss as exactly as
numbers do. So numbers count, unless they show more loss by far than most of these.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from librt.vecs import vec
from mypy_extensions import i64

from airlink.clock import Instant, seconds_between
from airlink.messages import KINDS
from gcs_formation.core.cycle import EACH_SECOND, Cycle, Stage
from gcs_formation.fleet.frame_loss import FrameLoss
from gcs_formation.vehicle.vehicle import Vehicle

FILTERED: Final = 0.05
"""Share of lost frames by which numbers must exceed streams, beyond what chance explains: a filter is there. Tuned:
share; 0.03 to 0.1; by judgement."""
SIGMAS: Final = 4.0
"""Standard deviations of a binomial distribution that chance explains. Tuned: standard deviations; 3 to 5; shown by
`pytest tests/gcs_formation/features/stream_loss`."""
FEWEST, SHORTEST_S = 50.0, 5.0
"""A window's length: time in which as many messages of the fastest stream are due, and at least some seconds."""
TOO_FAST: Final = 1.05
"""A stream that comes faster by more than this ratio has another rate than requested, by somebody else's request.
Tuned: ratio; 1.03 to 1.2; shown by `pytest tests/gcs_formation/features/stream_loss`."""

UNKNOWN_GAP: Final = 5.0
"""Losses in a row behind a filter: as they come in bursts. Tuned: frames; 2 to 10; shown by `pytest
tests/gcs_formation/features/stream_loss`."""


class StreamLoss(FrameLoss):
    """Compares what comes of one vehicle's requested messages with what should come, window by window."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Start with nothing requested."""
        super().__init__(vehicle)
        self._sequence = vehicle.sequence
        self._expect(vehicle.rates_hz)
        self._due, self._came = 0.0, 0.0
        """How many messages should have come in all windows that tell, and how many did."""
        self._began, self._silent_s = Instant(0), 0.0
        """When the present window began, and the silences before it."""

    def _expect(self, rates_hz: Mapping[int, float]) -> None:
        self._expected_hz, self._rates_hz = rates_hz, list(rates_hz.values())
        self._places = vec[i64]([KINDS[each].index for each in rates_hz])
        self._window_s, self._counts = max(SHORTEST_S, FEWEST / max(self._rates_hz)), list[int]()
        """A window's length, s, and the counts at the beginning of the present one; without messages there is none."""

    def close_window(self) -> None:
        """Judge a window that is over, and begin the next if the messages have been requested, also since a restart."""
        vehicle = self.vehicle
        if self._sequence is not vehicle.sequence:  # another link is in use
            self._sequence, self._counts = vehicle.sequence, []
        if not vehicle.start_up.asked_for_telemetry:
            self._counts = []
            return
        if self._expected_hz is not vehicle.rates_hz:
            self._expect(vehicle.rates_hz)
        if self._counts:
            silent_s = vehicle.sequence.silent_s - self._silent_s
            received_s = seconds_between(self._began, vehicle.connection.last_received) - silent_s
            if received_s < self._window_s:
                return
            self._judge(received_s)
        self._began, self._silent_s = vehicle.connection.last_received, vehicle.sequence.silent_s
        self._counts = self._counted()

    @property
    def loss(self) -> float:
        """Share of the vehicle's frames that were lost in normal operation, without silences, 0 to 1."""
        by_numbers = self.vehicle.sequence.loss
        if self._due == 0.0:
            return by_numbers
        by_streams = max(0.0, 1.0 - self._came / self._due)
        by_chance = SIGMAS * math.sqrt(by_numbers * (1.0 - by_numbers) / self._due)
        return by_numbers if by_numbers - by_streams <= FILTERED + by_chance else by_streams

    @property
    def mean_gap(self) -> float:
        """Mean number of frames lost in a row; behind a filter, which makes gaps of its own, `UNKNOWN_GAP`."""
        sequence = self.vehicle.sequence
        return sequence.mean_gap if self.loss == sequence.loss else UNKNOWN_GAP

    @property
    def whole_loss(self) -> float:
        """Share of the vehicle's frames that were lost, silences included, 0 to 1."""
        sequence, by_streams = self.vehicle.sequence, self.loss
        by_numbers = sequence.loss
        if by_streams == by_numbers:
            return sequence.whole_loss
        # In silences the same share of what the numbers show never came this far.
        sent = float(sequence.received) / (1.0 - by_streams)
        silenced = float(sequence.missed) * (1.0 - by_numbers) / (1.0 - by_streams)
        return 1.0 - float(sequence.received) / (sent + silenced)

    def _judge(self, received_s: float) -> None:
        """Add what came in a window, of the median stream, by messages, and of those that come alike.

        The others have another rate, or are filtered too. A window tells nothing if they are the most.
        """
        each = zip(self._counts, self._counted(), self._rates_hz, strict=True)
        rows = [((now - before) / (rate_hz * received_s), rate_hz * received_s) for before, now, rate_hz in each]
        rows = [(share, due) for share, due in rows if share > 0.0 and due >= FEWEST]
        half = sum([due for _, due in rows]) / 2.0
        median = _median(rows, half)
        alike = [(share, due) for share, due in rows if abs(share - median) <= _by_chance(median, due)]
        due = sum([due for _, due in alike])
        if due > half and median <= TOO_FAST:
            self._due += due
            self._came += sum([share * due for share, due in alike])

    def _counted(self) -> list[int]:
        return [int(self.vehicle.messages_in[place]) for place in self._places]


class StreamLosses(Stage):
    """Judges the windows of all vehicles that are over. A loss that is asked for is by these from then on."""

    name = "stream_loss"
    when = EACH_SECOND
    after = (
        "own_parts",
        "budget",
    )

    def __init__(self, cycle: Cycle) -> None:
        """Replace what is known of each vehicle's lost frames."""
        self._each = [StreamLoss(vehicle) for vehicle in cycle.each]
        for each in self._each:
            cycle.findings.losses[each.vehicle.identity] = each

    def run(self, cycle: Cycle) -> None:
        """Close each vehicle's window of messages once it is over."""
        del cycle
        for each in self._each:
            each.close_window()


def _median(rows: list[tuple[float, float]], half: float) -> float:
    """Return the share in the middle of (share, weight), where `half` of the weight lies below."""
    for share, due in sorted(rows):
        half -= due
        if half <= 0.0:
            return share
    return 0.0


def _by_chance(share: float, due: float) -> float:
    """Return by how much the share that comes of a stream may differ from its expectation by chance alone."""
    share = min(share, 1.0)
    return SIGMAS * math.sqrt(share * (1.0 - share) / due) + 1.0 / due
