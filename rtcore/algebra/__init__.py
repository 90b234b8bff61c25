"""Exact crossings of lines and shapes: polynomials with whole coefficients, their real roots, and every shape as such polynomials."""
