"""`drumsqueal paper`."""
