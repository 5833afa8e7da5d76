"""Reading what others have measured: CSV, UFF58 and WAV, each to one evenly sampled record."""
