"""Reports vehicles that their pilots, or their own failsafes, fly outside the fence."""
