"""Live tracking: lines of JSON with scans in, estimates and plans out, recorded, and resumed after interruptions."""

from vedette.live.answers import Answer, encode_line
from vedette.live.building import build_live_loop
from vedette.live.lines import LineSplitter, iter_lines
from vedette.live.loop import LiveLoop, LiveState
from vedette.live.messages import MAX_LINE_BYTES, Message, read_message
from vedette.live.persistence import PersistentLoop
from vedette.live.server import LineServer, TcpServer

__all__ = [
    "MAX_LINE_BYTES",
    "Answer",
    "LineServer",
    "LineSplitter",
    "LiveLoop",
    "LiveState",
    "Message",
    "PersistentLoop",
    "TcpServer",
    "build_live_loop",
    "encode_line",
    "iter_lines",
    "read_message",
]
