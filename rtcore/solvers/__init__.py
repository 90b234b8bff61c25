"""Intersection methods by name, for comparison."""
