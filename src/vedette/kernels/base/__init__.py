"""Foundation of all kernels: types, compilation, the disk cache, array helpers."""
