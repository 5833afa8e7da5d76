"""`drumsqueal cycle`."""
