"""Shared parts of all command lines: commands imported on use, option types, output, exit statuses."""

from __future__ import annotations

import atexit
import errno
import gc
import math
import os
import signal
import sys
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from enum import IntEnum
from importlib import import_module
from io import TextIOWrapper
from types import FrameType
from typing import Any, NoReturn, TextIO, TypeVar

import click

from airlink import clock

Decorated = TypeVar("Decorated", bound=Callable[..., Any])
SIGNALS = (signal.SIGINT, signal.SIGTERM)
OBJECTS = 100_000
"""Threshold of the garbage collector, instead of 700: start-up, and a flight of a hundred, are a tenth faster."""
COMPILED = not str(clock.__file__).endswith(".py")
"""Whether the modules in the compile list are compiled in this installation."""


def version_option() -> Callable[[Decorated], Decorated]:
    """Return the option `--version` of a command."""
    build = "compiled" if COMPILED else "not compiled: flights take longer"

    def show(ctx: click.Context, _: click.Parameter, value: bool) -> None:
        if value and not ctx.resilient_parsing:
            from airlink.installed import installed_version  # noqa: PLC0415 - short commands don't need it

            click.echo(f"{ctx.find_root().info_name}, version {installed_version()}, {build}")
            ctx.exit()

    return click.option(
        "--version", is_flag=True, expose_value=False, is_eager=True, callback=show, help="Show the version and exit."
    )


def start(module: str) -> None:
    """Run the function `main` of a module, imported only now, so that Ctrl-C ends its import quietly too.

    Garbage is collected rarely, and not at exit, when the system frees all memory anyway.
    """
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _end)  # until the command installs a handler of its own
    gc.set_threshold(OBJECTS)
    atexit.register(gc.freeze)
    calculate_in_one_thread()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper) and stream.errors == "strict":
            stream.reconfigure(errors="backslashreplace")  # for characters that a terminal lacks, such as dashes
    import_module(module).main()


def calculate_in_one_thread() -> None:
    """Keep OpenBLAS from starting threads when numpy is imported, unless the environment sets their number.

    Sums then don't depend on the number of cores, and no thread busy-waits for work: 0.05 to 0.1 s of a short command.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def same_modules() -> dict[str, str]:
    """Return variables with which a Python process imports the same modules as this one.

    Without them it looks in its working directory first: from a directory with the source tree it would run that, not
    the installed and compiled package.
    """
    return {"PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path)), "PYTHONSAFEPATH": "1"}


@contextmanager
def rare_garbage_collection() -> Generator[None]:
    """Collect garbage within no more often than commands do; afterwards as before."""
    before = gc.get_threshold()
    if 0 < before[0] < OBJECTS:
        gc.set_threshold(OBJECTS, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)


def examples(*lines: str) -> str:
    """Return the examples at the end of a command's help."""
    return "\b\nExamples:\n" + "\n".join(f"  {line}" for line in lines)


class Command(click.Command):
    """A command that exits with status 3 if its output can't be written; click's own exit with 1, or a traceback."""

    def make_context(
        self, info_name: str | None, args: list[str], parent: click.Context | None = None, **extra: Any
    ) -> click.Context:
        """Parse the arguments; some (`--version`, `--help`) are answered at once."""
        with exit_if_unwritable():
            return super().make_context(info_name, args, parent, **extra)

    def invoke(self, ctx: click.Context) -> object:
        """Run the command."""
        with exit_if_unwritable():
            return super().invoke(ctx)


class WithDefault(click.Group):
    """A group with a default command, which gets arguments that begin with neither a command's name nor an option."""

    def __init__(self, *args: Any, default: str | None = None, **kwargs: Any) -> None:
        """Pass arguments that name no command to `default`; no arguments too, unless these show the help."""
        super().__init__(*args, **kwargs)
        self.default = default

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments of the group itself."""
        own = {option for each in self.get_params(ctx) for option in each.opts}
        named = args[0] in (*self.list_commands(ctx), *own) if args else self.no_args_is_help
        return super().parse_args(ctx, args if named or self.default is None else [self.default, *args])

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options, those of the default command first, and the list of commands."""
        default = None if self.default is None else self.get_command(ctx, self.default)
        if default is None:
            super().format_options(ctx, formatter)
            return
        options = (each for each in default.params if isinstance(each, click.Option))
        records = [each.get_help_record(ctx) for each in (*options, *self.get_params(ctx))]
        with formatter.section("Options"):
            formatter.write_dl([each for each in records if each is not None])
        self.format_commands(ctx, formatter)


class ImportedWhenChosen(Command, WithDefault):
    """A group that imports a command only when it is used, so that none pays for the imports of another."""

    def __init__(self, *args: Any, entries: Mapping[str, tuple[str, str]], **kwargs: Any) -> None:
        """Offer `entries`: the module and the line of help of each command, by its name and its object's."""
        super().__init__(*args, **kwargs)
        self.entries = entries

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names."""
        return sorted([*super().list_commands(ctx), *self.entries])

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the command of a name, None if there is none."""
        if cmd_name not in self.entries:
            return super().get_command(ctx, cmd_name)
        module, _ = self.entries[cmd_name]
        return getattr(import_module(module), cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the arguments name; for an unknown one, fail with the names that are allowed."""
        names = self.list_commands(ctx)
        if args[0] not in names and not ctx.resilient_parsing:
            near = get_close_matches(args[0], names, n=1)
            nearest = f" (did you mean '{near[0]}'?)" if near else ""
            ctx.fail(f"found command '{args[0]}'; allowed: {', '.join(names)}{nearest}")
        return super().resolve_command(ctx, args)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the group's own options; those of a default command would take its import."""
        click.Group.format_options(self, ctx, formatter)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list of commands without importing them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, self.entries[name][1]) for name in self.list_commands(ctx)])


class WholeNumber(click.IntRange):
    """A whole number in a range."""

    name = "integer"


class Number(click.FloatRange):
    """A finite number in a range."""

    name = "number"

    def convert(self, value: float, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number


UNWRITABLE = (errno.ENOSPC, errno.EPIPE, errno.EIO)
"""What a full disk, a closed pipe and a terminal that is gone say."""
SECONDS = Number(0)
"""A duration or a mission time, s."""
SEED = WholeNumber(0, 2**63 - 1)
"""A seed of the random streams: the same range as the scenario's key `seed`."""


def counted(number: int, what: str, plural: str = "s") -> str:
    """Return a number with its noun: `1 flight`, `2 flights`, `2 searches` with `plural` "es"."""
    return f"{number:,} {what}{plural * (number != 1)}"


class Status(IntEnum):
    """Exit statuses of all commands."""

    FINE = 0
    EXPECTATION_BROKEN = 1
    BAD_USAGE = 2
    COULD_NOT_GO_ON = 3
    INTERRUPTED = 130


def drop(stream: TextIO | None) -> None:
    """Discard what couldn't be written to a stream, and everything later.

    Otherwise Python would fail to write it again at exit, and so determine the exit status.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    if stream is not None:
        os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def tell(text: str, *, err: bool = False) -> None:
    """Print the result of a command; failing to write it doesn't change the result."""
    try:
        click.echo(text, err=err)
    except OSError:
        drop(sys.__stderr__ if err else sys.__stdout__)


def say(text: str, status: Status) -> Status:
    """Print a message to standard error if it can be written; return the status."""
    tell(text, err=True)
    return status


def fail(text: str, status: Status = Status.BAD_USAGE) -> NoReturn:
    """Print a message to standard error and exit."""
    sys.exit(say(text, status))


@contextmanager
def exit_if_unwritable() -> Generator[None]:
    """Exit where output within can't be written (a full disk, a closed pipe); bad usage keeps its exit status."""
    try:
        yield
    except click.ClickException as error:
        try:
            error.show()
        except OSError:
            drop(sys.__stderr__)
        sys.exit(error.exit_code)
    except OSError as error:
        unwritable = error.errno in UNWRITABLE and error.filename is None
        found = f"standard output can't be written: {error.strerror}" if unwritable else str(error)
        say(f"cannot go on: {found}", Status.COULD_NOT_GO_ON)
        drop(sys.__stdout__)
        sys.exit(Status.COULD_NOT_GO_ON)


@contextmanager
def interruptible() -> Generator[None]:
    """Let the first Ctrl-C or SIGTERM within raise KeyboardInterrupt; the second ends the process at once."""
    before = {number: signal.getsignal(number) for number in SIGNALS}
    taken = [number for number, handler in before.items() if handler is not signal.SIG_IGN]
    for number in taken:
        signal.signal(number, _raise)
    try:
        yield
    finally:
        for number in taken:
            signal.signal(number, before[number])


def _raise(_number: int, _frame: FrameType | None) -> None:
    for number in SIGNALS:
        signal.signal(number, _end)
    raise KeyboardInterrupt


def _end(_number: int, _frame: FrameType | None) -> None:
    os._exit(Status.INTERRUPTED)
