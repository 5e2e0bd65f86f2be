"""Scans that come in while they are taken: lines of JSON in, estimates and plans out; kept, and taken up again."""

from vedette.live.building import live_of
from vedette.live.keeping import Keeping
from vedette.live.loop import Live, LiveState, encoded
from vedette.live.messages import MOST_BYTES, Message, read_message
from vedette.live.serving import LineSplitter, Server

__all__ = [
    "MOST_BYTES",
    "Keeping",
    "LineSplitter",
    "Live",
    "LiveState",
    "Message",
    "Server",
    "encoded",
    "live_of",
    "read_message",
]
