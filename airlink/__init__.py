"""The wire: what both ends of a MAVLink link share. Independent of vehicles and formations."""
