"""Friction laws, one a file."""
