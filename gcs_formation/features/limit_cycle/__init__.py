"""Names a follower that swings about its slot, to the left and to the right, without end."""
