"""Equations of motion and what a state tells. Public names are exported by `jaxbiped`."""
