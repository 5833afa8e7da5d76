"""`drumsqueal check`."""
