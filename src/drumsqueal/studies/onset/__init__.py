"""Linear against nonlinear onset along a parameter."""
