"""A program's commands, each imported when it is chosen."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from importlib import import_module
from typing import Any, NamedTuple

import click


class Entry(NamedTuple):
    """Where a command is, and what the list of commands says of it."""

    module: str
    summary: str


class ImportedWhenChosen(click.Group):
    """Commands of which none pays for what another needs: the list of them imports none."""

    def __init__(self, *args: Any, entries: Mapping[str, Entry], **kwargs: Any) -> None:
        """Offer `entries`: each name is the command's in its module."""
        super().__init__(*args, **kwargs)
        self.entries = entries

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names."""
        return sorted([*super().list_commands(ctx), *self.entries])

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command by its name, None for one that isn't there."""
        if cmd_name not in self.entries:
            return super().get_command(ctx, cmd_name)
        return getattr(import_module(self.entries[cmd_name].module), cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that is named first; who mistypes it is told what there is."""
        names = self.list_commands(ctx)
        if args[0] not in names and not ctx.resilient_parsing:
            near = get_close_matches(args[0], names, n=1)
            nearest = f" (did you mean '{near[0]}'?)" if near else ""
            ctx.fail(f"found command '{args[0]}'; allowed: {', '.join(names)}{nearest}")
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the list without importing what's in it."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, self.entries[name].summary) for name in self.list_commands(ctx)])
