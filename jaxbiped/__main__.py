"""`python -m jaxbiped` is `jaxbiped`."""

from jaxbiped.cli import main

main()
