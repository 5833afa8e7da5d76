"""Time integration: steps, samples, sticking, chunks, many at once."""
