"""Records of delays that people have: numbers, the output of `ping`, tables with named columns."""
