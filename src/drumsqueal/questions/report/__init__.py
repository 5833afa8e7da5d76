"""`drumsqueal report`."""
