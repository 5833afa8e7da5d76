"""What a good engineer would write by hand for the transient in the plane: the rivals of the engine's speed."""
