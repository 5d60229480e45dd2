"""Parts of the campaigns: problems with known answers, what became of a solve, records, pictures."""
