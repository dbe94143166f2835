"""`python -m gcs_formation` is `gcs-formation`."""

from gcs_formation.cli import main

main()
