"""Studies: many flights of one scenario, over parameters and seeds."""
