"""What moves: the coordinates of a body, its mass and its contact surface."""
