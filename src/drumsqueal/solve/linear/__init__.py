"""The linear model about steady sliding: equilibrium, Jacobian, eigenvalues."""
