"""`drumsqueal scenes`."""
