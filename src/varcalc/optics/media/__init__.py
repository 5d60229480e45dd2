"""What rays go through: the index as a function of place.

``medium`` (uniform, layered, central, graded, and :class:`Field`, their values on arrays), ``tabulated`` (measured
heights), ``dispersion`` (of the wavelength), ``catalogue`` (lenses, atmospheres, the sea), ``maupertuis`` (particles
as rays), ``profile_file`` (tables read from files).
"""
