"""Passes over graphs of scalar operations."""
