"""Bristle friction laws."""
