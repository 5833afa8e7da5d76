"""`drumsqueal run`."""
