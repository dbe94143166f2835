"""The course of a run: phases, orders, changes of the formation, endings."""
