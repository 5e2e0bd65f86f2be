"""Everything compiled. Arrays in, arrays out. This layer knows none of the classes above it."""
