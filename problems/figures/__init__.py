"""Figures of the literature drawn anew, one file each: `varcalc figure NUMBER`."""
