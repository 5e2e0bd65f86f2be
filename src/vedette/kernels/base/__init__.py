"""What every kernel stands on: types, compiling, the cache on disk, arrays."""
