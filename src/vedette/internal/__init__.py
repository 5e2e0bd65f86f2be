"""Modules that several packages use and that are not part of the public API."""
