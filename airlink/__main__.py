"""`python -m airlink` is `airlink-proxy`."""

from __future__ import annotations

from airlink.cli import start


def main() -> None:
    """Run the proxy."""
    start("airlink.cli.proxy")


if __name__ == "__main__":
    main()
