"""Who is there, and does what it is commanded."""
