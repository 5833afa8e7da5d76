"""`drumsqueal export`."""
