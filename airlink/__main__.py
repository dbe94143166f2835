"""`python -m airlink` is `airlink-proxy`."""

from __future__ import annotations

from airlink.cli.commands import calculate_in_one_thread
from airlink.cli.exit_status import end_quietly


def main() -> None:
    """Run the proxy."""
    end_quietly()
    calculate_in_one_thread()
    from airlink.cli.proxy import main as proxy  # noqa: PLC0415 - Ctrl-C ends its import too

    proxy()


if __name__ == "__main__":
    main()
