"""Euler and Lagrange's equation integrated from initial states that Newton's iteration corrects."""
