"""Variational equations: tangents, saltation, first and second variation, adjoint."""
