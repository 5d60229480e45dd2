"""The ladder over the methods, warm starts, sweeps, and the diagnosis of what has no answer."""
