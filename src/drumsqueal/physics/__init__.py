"""What moves and what acts on it: one vector field for everything that solves."""
