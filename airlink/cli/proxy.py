"""`airlink-proxy`: puts an impaired link between autopilots and any ground station."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from typing import Final

import click

from airlink.cli.arguments import SEED
from airlink.cli.status import Status, fail
from airlink.endpoint import Endpoint, parse_endpoint
from airlink.errors import EndpointError, ImpairmentError, PortError
from airlink.impairment import Direction
from airlink.impairment_keys import KEYS, apply_line, changed, described
from airlink.proxy import Proxy
from airlink.relay import Relay

LONGEST_LINE: Final = 4096
EXAMPLES: Final = """\b
Every option that takes a VALUE is there for one direction too: --uplink-delay-ms
(to the vehicle), --downlink-loss (from it), ...
While it runs, lines on standard input change what is set: delay-ms 300,
downlink loss 0.1, outage on.

\b
Example:
  airlink-proxy --listen udpin:127.0.0.1:14650 --to udpout:127.0.0.1:14550 \\
      --delay-ms 200 --jitter-ms 20 --downlink-loss 0.02
"""


class Console:
    """Applies lines from standard input; answers each with the new settings, or with what is allowed."""

    def __init__(self, relay: Relay) -> None:
        """Change the impairments of `relay`."""
        self._relay = relay
        self._begun = b""

    def take(self, data: bytes) -> None:
        """Apply the lines that `data` completes; empty `data` is the end of input and completes the last one."""
        *lines, begun = (self._begun + (data or b"\n")).split(b"\n")
        self._begun = begun[-LONGEST_LINE:]
        for line in lines:
            if line.strip():
                click.echo(self._answer(line.decode("utf-8", "replace").strip()))

    def _answer(self, line: str) -> str:
        try:
            apply_line(self._relay.impairments, line)
        except ImpairmentError as error:
            return f"error: {error}"
        return settings(self._relay)


def settings(relay: Relay) -> str:
    """Return the settings, one line for each direction."""
    return "\n".join(f"{way.name.lower()}: {described(relay.impairments[way])}" for way in Direction)


def summary(relay: Relay) -> str:
    """Return the statistics of both directions on one line."""
    parts: list[str] = []
    for way in Direction:
        done = relay.statistics(way)
        delay = f", mean delay {done.mean_delay_s * 1e3:.1f} ms" if done.delivered else ""
        parts.append(f"{way.name.lower()}: {done.datagrams} datagrams, {done.lost} lost{delay}")
    return "; ".join(parts)


def _connection(kind: str) -> Callable[[click.Context, click.Parameter, str], Endpoint]:
    """Return a callback that parses a connection string of one kind, `udpin` or `udpout`."""

    def read(_context: click.Context, _parameter: click.Parameter, text: str) -> Endpoint:
        try:
            endpoint = parse_endpoint(text)
        except EndpointError as error:
            raise click.BadParameter(str(error)) from error
        if endpoint.kind != kind:
            raise click.BadParameter(f"found '{text}'; allowed: {kind}:HOST:PORT")
        return endpoint

    return read


def _impairment_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add an option of each key for both directions, and hidden ones for each direction."""
    for prefix in ("downlink-", "uplink-", ""):
        for name, key in reversed(KEYS.items()):
            option = click.option(f"--{prefix}{name}", metavar="VALUE", help=key.help, hidden=bool(prefix))
            command = option(command)
    return command


def _set(relay: Relay, options: dict[str, str | None]) -> None:
    """Apply the options; those for one direction override those for both.

    Raises:
        UsageError: a value isn't allowed.
    """
    for way in Direction:
        for prefix in ("", f"{way.name.lower()}-"):
            for name in KEYS:
                text = options[f"{prefix}{name}".replace("-", "_")]
                if text is None:
                    continue
                try:
                    relay.impairments[way] = changed(relay.impairments[way], name, text)
                except ImpairmentError as error:
                    raise click.UsageError(f"--{prefix}{error}") from error


@click.command(epilog=EXAMPLES, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="gcs-formation")
@click.option(
    "--listen", metavar="UDPIN", callback=_connection("udpin"), required=True, help="where the vehicles send to"
)
@click.option(
    "--to", metavar="UDPOUT", callback=_connection("udpout"), required=True, help="where the ground station listens"
)
@click.option("--seed", type=SEED, default=1, show_default=True, help="of the random numbers")
@_impairment_options
def main(listen: Endpoint, to: Endpoint, seed: int, **options: str | None) -> None:
    """Put an impaired link between vehicles and a ground station."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.default_int_handler)  # a shell's background jobs ignore SIGINT
    relay = Relay(seed)
    _set(relay, options)
    try:
        with Proxy(listen, to, relay) as proxy:
            click.echo(f"{listen} -> {to}\n{settings(relay)}", err=True)
            if sys.stdin is not None:  # None where it was closed from the start
                proxy.watch(sys.stdin.fileno(), Console(relay).take)
            proxy.run(lambda: False)
    except PortError as error:
        fail(f"error: {error}", Status.COULD_NOT_GO_ON)
    except KeyboardInterrupt:
        click.echo(summary(relay))
        sys.exit(Status.INTERRUPTED)
