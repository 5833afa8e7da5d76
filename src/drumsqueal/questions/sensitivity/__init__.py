"""`drumsqueal sensitivity`."""
