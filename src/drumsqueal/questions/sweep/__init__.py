"""`drumsqueal sweep`."""
