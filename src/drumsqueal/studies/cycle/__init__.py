"""Periodic motions: found by shooting, and followed along a parameter."""
