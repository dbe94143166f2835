"""Base classes of what comes from outside. Compiled code holds them, and inherits nothing.

A method that raises, or returns a value that isn't finite, ends the flight safely: it is recorded as a failure with
the extension's file and line, vehicles are commanded to circle, and the exit status is 3.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path

from formation_scenario.register import Extension
from gcs_formation.control.plain_values import FollowerModel, FollowerSlot
from gcs_formation.extend.cycle import Cycle
from gcs_formation.extend.flight_window import FlightWindow
from gcs_formation.recorder import Event

Vector3 = tuple[float, float, float]


class FollowerLaw(Extension, ABC):
    """The feedback of one follower, between the mixer (13) and the envelope; there is an instance for each follower.

    Prediction over the links, feed-forward, envelope, separation rule and fence stay as they are, so that laws are
    compared by what they do with the errors alone.
    """

    replaced: tuple[bool, bool, bool] = (False, False, False)
    """Channels (speed, heading, height) whose last setpoint was a filter's, the separation rule's or the fence's."""
    excess: Vector3 = (0.0, 0.0, 0.0)
    """What the envelope added to the last feedback, m/s, rad, m: 0 where nothing was limited. An integral that is
    moved by it, or held while it isn't 0 or the channel is `replaced`, doesn't wind up."""

    @abstractmethod
    def feedback(self, error: Vector3, error_rate: Vector3, dt_s: float) -> Sequence[float]:
        """Return what is added to the feed-forward setpoint: speed m/s, heading rad, height m.

        Args:
            error: the mixed errors e_v (m/s), e_psi (rad) and e_z (m) of (13): commanded minus actual, so that a
                positive gain on them makes the vehicle fly faster, turn right, climb. For multirotors the first two are
                forward and right errors, m, weighted by `law.mixer.k_x`, and so are the feedback's, m/s.
            error_rate: their rates of change, per second.
            dt_s: time since the last tick, s.
        """

    def reset(self) -> None:
        """Forget what was accumulated: the follower isn't commanded, or follows another leader."""

    def delay_margins_s(self, follower: FollowerModel) -> Mapping[str, float] | None:  # noqa: ARG002 - by default unknown
        """Return how long a delay each loop around a follower stands without prediction, s, by the loop's name.

        The delay is of the whole loop: round trip, sampling and hold. None, the default: it isn't known, and nothing
        is said in its place. 0 or less: unstable without delay.
        """
        return None

    def mismatch_margins_s(self, follower: FollowerModel, delay_s: float) -> Mapping[str, float] | None:  # noqa: ARG002 - as above
        """Return by how much the delay may differ from the predicted `delay_s` before a loop is unstable, s, by loop.

        It counts with prediction (`law.delay_compensation`), and the names are those of `delay_margins_s`.
        """
        return None


class FormationLaw(Extension, ABC):
    """A law over all followers at once: it makes their setpoints. The leader flies its path by the guidance."""

    @abstractmethod
    def setpoints(self, followers: Sequence[FollowerSlot], dt_s: float) -> Mapping[int | str, Sequence[float]]:
        """Return speed m/s, heading rad and height m for each follower's id, before the envelope limits them.

        Args:
            followers: those that are commanded now, in the scenario's order, each with its own state, its leader's at
                the same instant, its slot and its errors.
            dt_s: time since the last tick, s.
        """

    def reset(self) -> None:
        """Forget what was accumulated: another vehicle leads."""

    def delay_margins_s(self, followers: Sequence[FollowerModel]) -> Mapping[str, float] | None:  # noqa: ARG002 - by default unknown
        """Return how long a delay each loop around all vehicles stands without prediction, s; see `FollowerLaw`."""
        return None

    def mismatch_margins_s(
        self,
        followers: Sequence[FollowerModel],  # noqa: ARG002 - by default unknown
        delay_s: float,  # noqa: ARG002
    ) -> Mapping[str, float] | None:
        """Return by how much the delay may differ from the predicted one, s, by loop; see `FollowerLaw`."""
        return None


class SetpointFilter(Extension, ABC):
    """Changes setpoints between law and fence. Filters run in the order of the scenario's `extensions`.

    What it changes is what was commanded, everywhere: to the prediction, to the law's integrals, to the monitors. It
    stays within the vehicle's envelope; fence, separation rule and ground come after it.
    """

    @abstractmethod
    def apply(self, cycle: Cycle) -> None:
        """Look at a control tick, and replace setpoints of it by `vehicle.replace`."""


class Monitor(Extension, ABC):
    """Watches control ticks as they are commanded in the end, and raises events."""

    @abstractmethod
    def watch(self, cycle: Cycle) -> None:
        """Look at a control tick; `cycle.event` records an event."""


class Recorder(Extension):
    """A sink of its own for ticks and events, beside the run directory's files."""

    def open(self, directory: Path) -> None:
        """Begin to record; `directory` is the run's, for a recorder that has no other place."""

    def tick(self, cycle: Cycle) -> None:
        """Take a tick, also one at which no vehicle is commanded."""

    def event(self, event: Event) -> None:
        """Take an event: `now` (ns), `kind`, `text`, `vehicle` (None for the run) and `details`."""

    def close(self) -> None:
        """End the record."""


class Metric(Extension, ABC):
    """A figure of a flight, for `expect` and for studies."""

    @abstractmethod
    def measure(self, flight: FlightWindow) -> float | None:
        """Return the figure over a window of a flight; None if it has none."""
