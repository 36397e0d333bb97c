"""Commands as data: what can be asked for, and what is refused before anything slow is imported."""
