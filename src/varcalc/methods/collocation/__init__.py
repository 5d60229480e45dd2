"""Euler and Lagrange's equation collocated at Gauss points, with Newton and refinement."""
