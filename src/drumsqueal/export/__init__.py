"""Time histories for other programs: which signals, which part of them, and one module for each format."""
