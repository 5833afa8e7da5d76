"""`drumsqueal effects`."""
