"""`drumsqueal stability`."""
