"""Intermediate representation: graphs of scalar operations, and passes over them."""
