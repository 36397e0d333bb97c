"""The second engine: the scene's own step, compiled to vector code for the host's CPU."""
