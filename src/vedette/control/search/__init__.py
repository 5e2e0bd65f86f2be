"""Searches over the joint actions of all sensors for the largest mean reward."""
