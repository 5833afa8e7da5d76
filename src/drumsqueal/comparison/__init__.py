"""Prediction against transient: growth, frequency, saturation, the verdict in words."""
