"""`drumsqueal onset`."""
