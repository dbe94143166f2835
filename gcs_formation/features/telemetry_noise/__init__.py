"""Reports noise that isn't as declared, and airspeeds that aren't plausible."""
