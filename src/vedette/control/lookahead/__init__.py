"""Decisions over several periods at once: sequences of actions of all sensors, of which the first are taken."""
