"""Monte Carlo campaigns: many runs of many settings, on one machine or many, kept in a folder that nothing tears."""
