"""What is modelled and nothing else. Public names are exported by `jaxbiped`."""
