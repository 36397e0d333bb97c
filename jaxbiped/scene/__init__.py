"""What is modelled and nothing else: walker, ground, laws, and the scenes of them."""
