"""How good it was: OSPA, statistics over paired runs, figures and tables."""
