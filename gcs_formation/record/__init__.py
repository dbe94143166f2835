"""What a run leaves behind: frames, time series, events, summary."""
