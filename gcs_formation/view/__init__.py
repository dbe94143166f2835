"""The formation in a browser: `run --view`, `fly --view` and `gcs-formation view`.

A recording is read from a run's directory, while it is written or after, or from a telemetry log. The station has no
part in this: it writes its record, and a process of its own reads that and serves the page. So a viewer that is slow,
stopped or killed can't delay a tick.
"""
