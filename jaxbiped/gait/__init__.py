"""What a walk consists of: footsteps and energy. Public names are exported by `jaxbiped`."""
