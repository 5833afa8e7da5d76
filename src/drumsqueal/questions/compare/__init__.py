"""`drumsqueal compare`."""
