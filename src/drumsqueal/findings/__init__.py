"""What a recorded motion shows: from arrays to findings."""
