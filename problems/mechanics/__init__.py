"""Motions of mechanics, one file each: a system, how it begins, and what is known of its motion.

``varcalc move NAME`` carries one out; ``varcalc list --systems`` names them with their largest errors.
"""
