"""`drumsqueal accuracy`."""
