"""Decisions over several periods at once: sequences of actions of all sensors, of which the first are taken."""

from vedette.control.lookahead.beam import BeamSearch
from vedette.control.lookahead.courses import Sequence
from vedette.control.lookahead.planner import HorizonPlanner
from vedette.control.lookahead.problem import JointSequence, SequenceProblem, SequenceSearch
from vedette.control.lookahead.tree_search import TreeSearch

__all__ = [
    "BeamSearch",
    "HorizonPlanner",
    "JointSequence",
    "Sequence",
    "SequenceProblem",
    "SequenceSearch",
    "TreeSearch",
]
