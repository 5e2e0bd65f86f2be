"""Options of a scan and their combination: assignment, ranking, sampling, marginals and truncation."""
