"""Measured records: WAV, UFF and tables of text."""
