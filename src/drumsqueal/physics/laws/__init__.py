"""What friction asks of a law, those of a scene with their numbers, and laws given in Python; see `scene/laws`."""
