"""The parts of collocation: residual, boundary rows, damped Newton, refinement and errors."""
