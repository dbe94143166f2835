"""From measured states to setpoints: the leader's guidance, slots over the ground, the law, the envelope."""
