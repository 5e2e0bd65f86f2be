"""Modules that several packages use and that are no part of the public API."""
