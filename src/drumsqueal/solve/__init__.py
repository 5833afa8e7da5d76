"""Steady sliding, eigenvalues and motion in time of any model."""
