"""What a walk consists of: footsteps, their measures and their energy. Public names are exported by `jaxbiped` itself."""
