"""Programs of JAX as Python on arrays of NumPy, for what calls the lanes: nothing is compiled."""
