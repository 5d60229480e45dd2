"""What is asked: ends and constraints, Problem and Curve and their checks, L with its derivatives, both as text."""
