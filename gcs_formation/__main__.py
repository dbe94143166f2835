"""`python -m gcs_formation` is `gcs-formation`."""

from __future__ import annotations

from airlink.cli.commands import calculate_in_one_thread, look_seldom
from airlink.cli.exit_status import end_quietly


def main() -> None:
    """Run the command line."""
    end_quietly()
    look_seldom()
    calculate_in_one_thread()
    from gcs_formation.cli import main as cli  # noqa: PLC0415 - Ctrl-C ends its import too

    cli()


if __name__ == "__main__":
    main()
