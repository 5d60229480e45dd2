"""What is made of rays: ``wavefronts`` and caustics, the ``range_chart``, and a ``study`` with all that is drawn."""
