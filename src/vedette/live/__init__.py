"""Live tracking: lines of JSON with scans in, estimates and plans out; recorded, and resumed after interruptions."""

from vedette.live.building import live_of
from vedette.live.keeping import Keeping
from vedette.live.lines import LineSplitter, lines_of
from vedette.live.loop import Answer, Live, LiveState, encoded
from vedette.live.messages import MOST_BYTES, Message, read_message
from vedette.live.serving import Exchange, TcpServer

__all__ = [
    "MOST_BYTES",
    "Answer",
    "Exchange",
    "Keeping",
    "LineSplitter",
    "Live",
    "LiveState",
    "Message",
    "TcpServer",
    "encoded",
    "lines_of",
    "live_of",
    "read_message",
]
