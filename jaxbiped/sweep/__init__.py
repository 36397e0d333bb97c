"""Basins of attraction: starts, labels, sweeps and stores. Public names: see `jaxbiped`."""
