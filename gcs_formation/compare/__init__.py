"""Laws side by side: the same scenario and seed flown by each, in one table, one figure and one page."""
