"""`python -m gcs_formation` is `gcs-formation`."""

from __future__ import annotations

from airlink.cli import start


def main() -> None:
    """Run the command line."""
    start("gcs_formation.cli")


if __name__ == "__main__":
    main()
