"""`drumsqueal fit`."""
