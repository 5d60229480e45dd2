"""The parts of the direct method: spaces and systems, the optimisers, the rungs and their errors."""
