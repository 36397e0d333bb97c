"""Viewer of walks: pages and widgets that play them. `jaxbiped.plot` has its public names."""
