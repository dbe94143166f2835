"""The wire: what both ends of a MAVLink link share. Knows no vehicle and no formation."""
