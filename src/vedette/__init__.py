"""Vedette: where should a network of mobile sensors go next, so that together they track best?"""

__version__ = "0.1.0"
