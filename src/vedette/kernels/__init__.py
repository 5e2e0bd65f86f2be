"""Everything compiled. Arrays in, arrays out; knows none of the classes above it."""
