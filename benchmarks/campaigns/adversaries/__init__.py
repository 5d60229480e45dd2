"""Families of problems made to mislead, each with its least value by other means than the library's own."""
