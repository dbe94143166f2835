"""One survey from beginning to end, on sockets and the real clock."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from airlink.clock import Instant, RealClock, after
from airlink.driver import Driver
from airlink.endpoint import Endpoint, PortError
from gcs_formation.errors import RunAbortedError
from gcs_formation.link_survey.survey import LinkSurvey


def surveyed(
    endpoints: Sequence[Endpoint],
    seconds: float,
    probe_hz: float,
    load_kbps: float | None,
    ended: Callable[[LinkSurvey, Instant], bool],
) -> tuple[LinkSurvey, Instant]:
    """Survey for some seconds, and then, up to `load_kbps`, what the links carry; return it and when it ended.

    `ended` is asked ten times a second whether to end before.

    Raises:
        RunAbortedError: an endpoint can't be opened.
    """
    survey, clock = LinkSurvey(endpoints, after(Instant(0), seconds), probe_hz, load_kbps), RealClock()
    try:
        with Driver(survey, clock) as driver:
            driver.run(lambda: clock.now() >= survey.over or ended(survey, clock.now()))
    except PortError as error:
        raise RunAbortedError(str(error)) from error
    return survey, min(clock.now(), survey.over)
