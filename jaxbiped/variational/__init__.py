"""Variational equations."""
