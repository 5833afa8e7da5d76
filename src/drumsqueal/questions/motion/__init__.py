"""`drumsqueal motion`."""
