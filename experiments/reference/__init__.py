"""Independent walkers: the equations of motion and the laws of contact written a second time.

Nothing here is shared with jaxbiped, whose results tests and experiments hold against it.
"""
