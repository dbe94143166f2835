"""A run from its start to its end: phases, orders, changes of the formation, endings."""
