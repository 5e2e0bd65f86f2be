"""Scans that come in while they are taken: lines of JSON in, estimates and plans out; kept, and taken up again."""

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
