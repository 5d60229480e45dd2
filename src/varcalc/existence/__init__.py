"""Whether there is a minimum at all, and what stands in its way.

Looked at only where no method gave an answer: levels out of reach, functionals
without a bound, minima with corners, infima that no curve attains. The modules
are imported where they are used, for most problems never need them.
"""
