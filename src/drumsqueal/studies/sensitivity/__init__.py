"""What to change to make a brake quiet."""
