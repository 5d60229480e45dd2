"""One adapter a package: the same work, written the way that package wants it."""
