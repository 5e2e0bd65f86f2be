"""What each track may have caused in a scan, and the best, sampled or summed choices of all tracks together."""
