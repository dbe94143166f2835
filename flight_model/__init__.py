"""Mathematics of flight shared by vehicles and ground station; independent of scenarios and messages."""
