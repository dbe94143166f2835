"""What a vehicle was commanded and how it flew, from a log, on a uniform time grid."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path
from typing import Final

import numpy as np

from flight_model.arrays import Array, Mask
from flight_model.slot import CHANNELS
from formation_scenario.bounded_read import require_file
from gcs_formation.errors import RecordError
from gcs_formation.identify.logs import READERS
from gcs_formation.identify.logs.telemetry import CYCLE_S
from gcs_formation.identify.logs.track import HOVERING_SEEN, SEEN, Track
from gcs_formation.vehicle.command_delivery import REPEAT_S

__all__ = ["CYCLE_S", "MIN_MOVED", "STEP_S", "Recording", "recordings"]

STEP_S = 0.1
"""Step of the grid."""
SILENT_S = 1.0
"""A state older than this breaks the recording."""
SETPOINT_SILENT_S = 2.5 * REPEAT_S
"""A setpoint older than this breaks it too. Constant ones are repeated each `REPEAT_S` and a tick; one may be lost."""
SETTLING_S = 15.0
"""Take-off transients within this time aren't used."""
MOVES_MPS = 1.0
"""Below this speed a course isn't used."""
MIN_S = 30.0
"""Shorter stretches under setpoints aren't used."""
MIN_MOVED = {"speed": (0.5, "m/s"), "heading": (0.05, "rad"), "height": (2.0, "m")}
"""Least change of each setpoint from which its channel can be identified."""
FREELY_MPS2 = 1e3
"""Lateral acceleration that doesn't limit turns."""
UNSEEN: Final = (15.0, 0.0, 0.0, 0.0)
"""What stands for a response that wasn't logged, in a channel that isn't fitted: airspeed, heading, height, climb."""
LABELS = {
    "airspeed": "airspeed, m/s",
    "speed seen": "ground speed, m/s",
    "yaw": "heading, degrees",
    "course": "course, degrees",
    "alt": "height, m",
}


@dataclass(frozen=True)
class Recording:
    """One vehicle's longest stretch under setpoints: K points, `STEP_S` apart."""

    system: int
    seen: Array
    """(4, K) airspeed (m/s), heading (rad, not wrapped), height (m above sea level) and climb (m/s)."""
    commanded: Array
    """(3, K) setpoints of speed, heading and height as received: the mean over the step that begins there."""
    delay_s: float = 0.0
    """Round-trip delay of the link, which isn't part of the vehicle's time constants."""
    names: tuple[str, ...] = SEEN
    """Names of the quantities in `seen`."""
    lateral_mps2: Array = field(default_factory=lambda: np.array([FREELY_MPS2]))
    """(K,) or (1,) lateral acceleration of commanded turns, m/s2: it limits the turn rate, the more the faster it
    flies."""

    samples: tuple[tuple[Array, Array], ...] = ()
    """Times, in steps since the first point, and values of each of the three channels' measurements; if empty, `seen`.
    """

    channels: tuple[str, ...] = CHANNELS
    """Those of speed, heading and height of which the log has setpoints and responses; the other rows of `commanded`
    are what was seen."""
    track: Track = field(default_factory=lambda: Track(0))
    """The location in the log of the setpoints."""
    modes: tuple[str, ...] = ()
    """The vehicle's flight modes meanwhile, where they are logged."""

    def moved(self) -> dict[str, float]:
        """Return by how much the setpoint of each logged channel changed."""
        spans = zip(CHANNELS, np.ptp(self.commanded, axis=1).tolist(), strict=True)
        return {name: span for name, span in spans if name in self.channels}

    def excited(self) -> int:
        """Return of how many channels the setpoints changed enough."""
        return sum(span >= MIN_MOVED[name][0] for name, span in self.moved().items())

    def measured(self) -> tuple[tuple[Array, Array], ...]:
        """Return the times, in steps since the first point, and values of each channel's measurements.

        A channel that isn't in `channels` has none: without its setpoints they tell nothing of how it answers.
        """
        points, none = np.arange(self.seen.shape[1], dtype=np.float64), np.empty(0)
        every = self.samples or tuple((points, each) for each in self.seen[:3])
        named = zip(CHANNELS, every, strict=True)
        return tuple(samples if channel in self.channels else (none, none) for channel, samples in named)

    @property
    def labels(self) -> tuple[str, ...]:
        """Labels of the channels in a figure, with units."""
        return tuple(LABELS[name] for name in self.names[:3])

    @property
    def duration_s(self) -> float:
        """How long it is."""
        return self.seen.shape[1] * STEP_S


def recordings(log: Path, delays_s: Mapping[int, float] | None = None) -> list[Recording]:
    """Return the recording of each vehicle that flew under setpoints, by id, from a log of any format (`READERS`).

    Of a vehicle's tracks, that with the most excited channels is taken; of equals, the first.

    Args:
        log: the file.
        delays_s: round-trip delay of each system's link.

    Raises:
        RecordError: the log can't be read, or no vehicle flew under setpoints for `MIN_S`.
    """
    suffix = log.suffix.lower()
    try:
        require_file(log)
        read = READERS[suffix](log)
    except OSError as error:
        raise RecordError(f"{log}: {error.strerror or error}") from error
    except KeyError as error:
        raise RecordError(f"{log}: found a table without {error}; allowed: a log as its autopilot writes it") from error
    except ValueError as error:
        raise RecordError(f"{log}: found {error}; allowed: a log as its autopilot writes it") from error
    delays, best = delays_s or {}, dict[int, Recording]()
    for track in read.tracks:
        found = _of_track(track, delays.get(track.system, 0.0))
        if found is not None and (track.system not in best or found.excited() > best[track.system].excited()):
            best[track.system] = found
    if not best:
        raise RecordError(f"{log}: found {read.found}; allowed: {read.wanted}")
    return [best[system] for system in sorted(best)]


def _of_track(track: Track, delay_s: float) -> Recording | None:
    """Return the recording of as many channels as there are, or of fewer, if more of these are excited."""
    best: Recording | None = None
    for count in range(len(CHANNELS), 0, -1):
        if best is not None and best.excited() >= count:
            break
        for channels in combinations(CHANNELS, count):
            found = _gridded(track, delay_s, channels)
            if found is not None and (best is None or found.excited() > best.excited()):
                best = found
    return best


def _gridded(track: Track, delay_s: float, channels: Sequence[str]) -> Recording | None:
    """Return the longest stretch without gaps of these channels; None if it is too short."""
    names = track.seen
    needed = [*channels, *(name for channel, name in zip(CHANNELS, names, strict=False) if channel in channels)]
    needed += [names[3]] if "height" in channels and names[3] in track.of else []
    every = {name: np.array(samples) for name, samples in track.of.items() if len(samples) >= 2}
    if any(name not in every for name in needed):
        return None
    begin, end = (pick(every[name][at, 0] for name in needed) for pick, at in ((max, 0), (min, -1)))
    at_s = np.arange(begin, end, STEP_S)
    if at_s.size < 2:
        return None
    for angle in {"heading", names[1]} & set(every):
        every[angle][:, 1] = np.unwrap(every[angle][:, 1])
    seen = _seen(every, names, at_s)
    late_s = at_s - track.wait_s
    commanded = np.array(
        [_held(every[name], late_s) if name in channels else seen[row] for row, name in enumerate(CHANNELS)]
    )
    fresh = track.during(at_s)
    for name in needed:
        fresh &= at_s - _newest_s(every[name], at_s) < (SETPOINT_SILENT_S if name in CHANNELS else SILENT_S)
    fresh[: round(SETTLING_S / STEP_S)] = False
    if names == HOVERING_SEEN and {"speed", "heading"} & set(channels):
        fresh &= np.minimum(commanded[0], seen[0]) > MOVES_MPS
    stretch = _longest(fresh)
    if (stretch.stop - stretch.start) * STEP_S < MIN_S:
        return None
    commanded, seen, at_s = commanded[:, stretch], seen[:, stretch], at_s[stretch]
    commanded[1] += 2 * np.pi * np.round(np.median(seen[1] - commanded[1]) / (2 * np.pi))
    turning = np.array(track.of.get("lateral", [(begin, FREELY_MPS2)]))
    measured = tuple(
        _within(every[name], at_s) if channel in channels else (np.arange(float(at_s.size)), seen[row])
        for row, (channel, name) in enumerate(zip(CHANNELS, names, strict=False))
    )
    flown = tuple({mode.name: 0 for mode in track.modes if mode.begin_s < at_s[-1] and mode.end_s > at_s[0]})
    return Recording(
        track.system, seen, commanded, delay_s, names, _held(turning, late_s)[stretch], measured, tuple(channels),
        track, flown,
    )  # fmt: skip


def _seen(every: Mapping[str, Array], names: Sequence[str], at_s: Array) -> Array:
    """Return the responses (4, K); the climb is that of the height where it isn't logged."""
    rows = [
        np.interp(at_s, every[name][:, 0], every[name][:, 1]) if name in every else np.full(at_s.shape, instead)
        for name, instead in zip(names, UNSEEN, strict=True)
    ]
    if names[3] not in every:
        rows[3] = np.gradient(rows[2], STEP_S)
    return np.array(rows)


def _within(samples: Array, at_s: Array) -> tuple[Array, Array]:
    """Return the times of samples within a time grid, in its steps, and their values."""
    steps = (samples[:, 0] - at_s[0]) / STEP_S
    inside = (steps >= 0.0) & (steps <= len(at_s) - 1.0)
    return steps[inside], samples[inside, 1]


def _newest_s(samples: Array, at_s: Array) -> Array:
    """Return the time of the newest sample at each moment, (K,)."""
    return samples[np.maximum(np.searchsorted(samples[:, 0], at_s, side="right") - 1, 0), 0]


def _held(samples: Array, at_s: Array) -> Array:
    """Return the mean over the step after each moment (K,) of a value that is held until the next sample."""
    ends_s = np.append(samples[1:, 0], max(samples[-1, 0], at_s[-1]) + 2 * STEP_S)
    first = samples[0, 1]
    summed = np.concatenate(([0.0], np.cumsum((samples[:, 1] - first) * (ends_s - samples[:, 0]))))
    begin, end = (np.interp(each, np.append(samples[:, 0], ends_s[-1]), summed) for each in (at_s, at_s + STEP_S))
    return first + (end - begin) / STEP_S


def _longest(flags: Mask) -> slice:
    """Return the longest run of True."""
    borders = np.flatnonzero(np.diff(np.concatenate(([0], flags.astype(np.int8), [0]))))
    runs = [slice(int(begin), int(end)) for begin, end in borders.reshape(-1, 2)]
    return max(runs, key=lambda run: run.stop - run.start, default=slice(0, 0))
