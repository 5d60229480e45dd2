"""The direct method: a discretised functional on a mesh, minimised by Newton or IPOPT, refined by its error."""
