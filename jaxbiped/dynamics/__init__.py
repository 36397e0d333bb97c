"""Equations of motion of a scene, and what can be read off a state. Public names are exported by `jaxbiped` itself."""
