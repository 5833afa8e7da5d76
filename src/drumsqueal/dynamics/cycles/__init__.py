"""Limit cycles of a model, and their branches along a parameter."""
