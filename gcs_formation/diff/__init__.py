"""What differs between the records of two runs."""
