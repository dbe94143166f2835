"""`airlink-proxy`: puts an impaired link between autopilots and any ground station."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from types import MappingProxyType
from typing import IO, Any, Final, NamedTuple

import click

from airlink.cli import SEED, SIGNALS, Command, Status, fail, fault_option, radio_option, version_option
from airlink.delay_record import DelayRecord
from airlink.endpoint import Endpoint, EndpointError, ImpairmentError, PortError, parse_endpoint
from airlink.impairment import Direction, Impairment
from airlink.proxy import Proxy
from airlink.radio.settings import RadioSettings
from airlink.relay import Relay
from airlink.telemetry_faults.passing import FaultError, LinkFault

LONGEST_LINE: Final = 4096
EXAMPLES: Final = """\b
Every option that takes a VALUE is there for one direction too: --uplink-delay-ms
(to the vehicle), --downlink-loss (from it), ...
While it runs, lines on standard input change what is set: delay-ms 300,
downlink loss 0.1, outage on, fault quantity=position,effect=freeze,for_s=20,
fault none.

\b
An ENDPOINT is udpin:HOST:PORT, udpout:HOST:PORT, tcp:HOST:PORT, tcpin:HOST:PORT,
serial:DEVICE:BAUD or mcast:GROUP:PORT.

\b
Examples:
  airlink-proxy --listen udpin:127.0.0.1:14650 --to udpout:127.0.0.1:14550 \\
      --delay-ms 200 --jitter-ms 20 --downlink-loss 0.02
  airlink-proxy --listen tcp:127.0.0.1:5760 --to tcpin:127.0.0.1:5790 --delay-ms 100
  airlink-proxy --listen serial:/dev/ttyUSB0:57600 --to udpout:127.0.0.1:14550
  airlink-proxy --listen udpin:127.0.0.1:14650 --to udpout:127.0.0.1:14550 \\
      --fault quantity=height,effect=offset,amount=-20,vehicles=[3],at_s=60
"""


class Key(NamedTuple):
    """One key: the field that it sets, its unit and range, and words for special values."""

    field: str
    help: str
    low: float = 0.0
    high: float = -1.0
    units: float = 1.0
    """Number of this unit in one SI unit."""
    or_zero: bool = False
    """Whether 0 is allowed too, below the range."""
    words: Mapping[str, Any] = MappingProxyType({})

    @property
    def allowed(self) -> str:
        """The allowed values, as text."""
        ranged = f"{'0, or ' if self.or_zero else ''}{self.low:g} to {self.high:.0f}"
        return ", ".join([*([ranged] if self.low <= self.high else []), *self.words])

    def read(self, text: str) -> Any:  # noqa: ANN401 - whatever a word stands for
        """Return the field's value of a text; ValueError if it isn't allowed."""
        if text in self.words:
            return self.words[text]
        value = float(text)
        if not self.low <= value <= self.high and not (self.or_zero and value == 0.0):
            raise ValueError(text)
        return value / self.units

    def show(self, value: Any) -> str:  # noqa: ANN401
        """Return the text that sets the field's value."""
        return next((word for word, named in self.words.items() if named == value), "") or f"{value * self.units:g}"


MAX_MS: Final = 600_000.0
MIN_KBPS: Final = 1e-3
"""1 bit/s: the longest datagram takes a week."""
FAULT: Final = "fault"
SWITCH: Final = {"on": True, "off": False}
NAMES: Final = {name: name for name in ("normal", "uniform", "pareto")}
BURST: Final = "mean number of datagrams lost in a row, none: each on its own"
KEYS = {
    "delay-ms": Key("delay_s", "delay", 0.0, MAX_MS, 1e3),
    "jitter-ms": Key("jitter_s", "standard deviation of the delay", 0.0, MAX_MS, 1e3),
    "distribution": Key("distribution", "of the jitter: normal, uniform or pareto", words=NAMES),
    "loss": Key("loss", "probability that a datagram is lost", 0.0, 1.0),
    "mean-burst": Key("mean_burst", BURST, 1.0, 1e6, words={"none": None}),
    "duplicate": Key("duplicate", "probability that a datagram comes twice", 0.0, 1.0),
    "rate-kbps": Key("rate_bps", "data rate; 0: no limit", MIN_KBPS, 1e6, 1e-3, or_zero=True),
    "queue-ms": Key("queue_s", "longest wait for the data rate", 0.0, MAX_MS, 1e3),
    "reorder": Key("reorder", "whether datagrams may overtake others", words=SWITCH),
    "outage": Key("outage", "whether everything is lost", words=SWITCH),
}


def changed(impairment: Impairment, key: str, text: str) -> Impairment:
    """Return `impairment` with one key set.

    Raises:
        ImpairmentError: no such key, or a value that isn't allowed; the message says what is.
    """
    if key not in KEYS:
        raise ImpairmentError(f"found key '{key}'; allowed: {', '.join(KEYS)}")
    try:
        value = KEYS[key].read(text)
    except ValueError:
        raise ImpairmentError(f"{key}: found '{text}'; allowed: {KEYS[key].allowed}") from None
    return replace(impairment, **{KEYS[key].field: value})


def described(impairment: Impairment) -> str:
    """Return all keys and their values on one line."""
    return ", ".join(f"{name} {key.show(getattr(impairment, key.field))}" for name, key in KEYS.items())


def apply_line(impairments: dict[Direction, Impairment], line: str) -> None:
    """Apply a line: `KEY VALUE` for both directions, `uplink KEY VALUE` or `downlink KEY VALUE` for one.

    Raises:
        ImpairmentError: the line isn't of that form, or its key or value isn't allowed; nothing is changed.
    """
    words = line.split()
    named = [direction for direction in Direction if words and words[0] == direction.name.lower()]
    directions, rest = named or list(Direction), words[len(named) :]
    if len(rest) != 2:
        raise ImpairmentError(f"found '{line}'; allowed: [uplink|downlink] KEY VALUE, KEY one of {', '.join(KEYS)}")
    impairments.update({direction: changed(impairments[direction], *rest) for direction in directions})


class Console:
    """Applies lines from standard input; replies to each with the new settings, or with an error."""

    def __init__(self, relay: Relay) -> None:
        self._relay, self._begun = relay, b""

    def feed(self, data: bytes) -> None:
        """Apply the lines that `data` completes; empty `data` is the end of input and completes the last one."""
        *lines, begun = (self._begun + (data or b"\n")).split(b"\n")
        self._begun = begun[-LONGEST_LINE:]
        for line in lines:
            if line.strip():
                click.echo(self._answer(line.decode("utf-8", "replace").strip()))

    def _answer(self, line: str) -> str:
        word, _, rest = line.partition(" ")
        try:
            if word == FAULT:
                self._relay.faults = fault_option.changed(self._relay.faults, rest.strip(), self._relay.elapsed_s)
            else:
                apply_line(self._relay.impairments, line)
        except (ImpairmentError, FaultError) as error:
            return f"error: {error}"
        return settings(self._relay)


def settings(relay: Relay) -> str:
    """Return the settings: one line for each direction, and for the radio and each fault if there are any."""
    lines = [f"{direction.name.lower()}: {described(relay.impairments[direction])}" for direction in Direction]
    lines += map(fault_option.described, relay.faults)
    return "\n".join(lines if relay.radio is None else [radio_option.described(relay.radio.settings), *lines])


def summary(relay: Relay) -> str:
    """Return the statistics of both directions on one line."""
    parts: list[str] = []
    for direction in Direction:
        done = relay.statistics(direction)
        delay = f", mean delay {done.mean_delay_s * 1e3:.1f} ms" if done.delivered else ""
        parts.append(f"{direction.name.lower()}: {done.datagrams} datagrams, {done.lost} lost{delay}")
    return "; ".join(parts)


def _endpoint(_context: click.Context, _parameter: click.Parameter, text: str) -> Endpoint:
    """Parse a connection string."""
    try:
        return parse_endpoint(text)
    except EndpointError as error:
        raise click.BadParameter(str(error)) from error


def _recording(relay: Relay, file: IO[str] | None) -> AbstractContextManager[object]:
    if file is None:
        return nullcontext()
    relay.record = DelayRecord(file)
    return relay.record


def _radio(_context: click.Context, _parameter: click.Parameter, text: str | None) -> RadioSettings | None:
    try:
        return None if text is None else radio_option.parse_radio(text)
    except ImpairmentError as error:
        raise click.BadParameter(str(error)) from error


def _faults(_context: click.Context, _parameter: click.Parameter, texts: tuple[str, ...]) -> tuple[LinkFault, ...]:
    try:
        return tuple(map(fault_option.parse_fault, texts))
    except FaultError as error:
        raise click.BadParameter(str(error)) from error


def _impairment_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add an option of each key for both directions, and hidden ones for each direction."""
    for prefix in ("downlink-", "uplink-", ""):
        for name, key in reversed(KEYS.items()):
            option = click.option(f"--{prefix}{name}", metavar="VALUE", help=key.help, hidden=bool(prefix))
            command = option(command)
    return command


def _set(relay: Relay, options: dict[str, str | None]) -> None:
    """Apply the options, those for one direction over those for both; UsageError if a value isn't allowed."""
    for direction in Direction:
        for prefix in ("", f"{direction.name.lower()}-"):
            for name in KEYS:
                text = options[f"{prefix}{name}".replace("-", "_")]
                try:
                    if text is not None:
                        relay.impairments[direction] = changed(relay.impairments[direction], name, text)
                except ImpairmentError as error:
                    raise click.UsageError(f"--{prefix}{error}") from error


@click.command(cls=Command, epilog=EXAMPLES, context_settings={"help_option_names": ["-h", "--help"]})
@version_option()
@click.option(
    "--listen", metavar="ENDPOINT", callback=_endpoint, required=True, help="where the vehicles are: udpin:HOST:PORT"
)
@click.option(
    "--to", metavar="ENDPOINT", callback=_endpoint, required=True, help="where the ground station is: udpout:HOST:PORT"
)
@click.option(
    "--radio",
    metavar="KEYS",
    callback=_radio,
    help="one radio that all vehicles share, as links.channels of a scenario: sik_915, or rate_kbps=57.6,duplex=half",
)
@click.option(
    "--fault",
    "faults",
    metavar="KEYS",
    callback=_faults,
    multiple=True,
    help="alter the telemetry that passes, as faults of a scenario do: "
    "quantity=position,effect=freeze,vehicles=[3],at_s=30,for_s=20; at_s is from the first datagram on",
)
@click.option(
    "--record",
    "recorded",
    metavar="FILE",
    type=click.File("w", encoding="utf-8", lazy=False),
    help="write the delays to a table, which a scenario's `trace` replays",
)
@click.option("--seed", type=SEED, default=1, show_default=True, help="of the random numbers")
@_impairment_options
def main(
    listen: Endpoint,
    to: Endpoint,
    radio: RadioSettings | None,
    faults: tuple[LinkFault, ...],
    recorded: IO[str] | None,
    seed: int,
    **options: str | None,
) -> None:
    """Put an impaired link between vehicles and a ground station."""
    for number in SIGNALS:
        signal.signal(number, signal.default_int_handler)  # a shell's background jobs ignore SIGINT
    relay = Relay(seed, radio)
    relay.faults = faults
    _set(relay, options)
    try:
        with Proxy(listen, to, relay) as proxy, _recording(relay, recorded):
            click.echo(f"{listen} -> {to}\n{settings(relay)}", err=True)
            if sys.stdin is not None:  # None where it was closed from the start
                proxy.watch(sys.stdin.fileno(), Console(relay).feed)
            proxy.run(lambda: False)
    except EndpointError as error:
        raise click.UsageError(f"--to: {error}") from error
    except PortError as error:
        fail(f"error: {error}", Status.COULD_NOT_GO_ON)
    except KeyboardInterrupt:
        click.echo(summary(relay))
        sys.exit(Status.INTERRUPTED)
