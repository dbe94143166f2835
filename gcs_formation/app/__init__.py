"""The shells that give the station its sockets, its clock and its vehicles."""
