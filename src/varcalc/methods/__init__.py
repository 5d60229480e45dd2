"""The methods, one a file: each turns a form into a Solution."""
