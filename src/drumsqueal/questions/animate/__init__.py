"""`drumsqueal animate`."""
