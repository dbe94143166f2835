"""Links of every kind behind one interface: what arrives, what is sent, and who the peer is, which stays opaque."""
