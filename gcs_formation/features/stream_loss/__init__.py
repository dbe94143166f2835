"""A vehicle's loss where a router passes some kinds of messages only."""
