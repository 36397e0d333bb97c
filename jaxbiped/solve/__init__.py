"""Stiff stepping through diffrax. Public names are exported by `jaxbiped`."""
