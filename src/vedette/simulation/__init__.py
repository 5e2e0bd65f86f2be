"""The world that the program does not get to see: truth, platforms, scans, and the loop."""
