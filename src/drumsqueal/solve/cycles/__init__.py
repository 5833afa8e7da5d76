"""Periodic motions of a model by shooting, their Floquet multipliers, and where branches of them cross."""
