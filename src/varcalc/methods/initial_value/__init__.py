"""The parts of shooting: the flow, its segments, initial states and their search."""
