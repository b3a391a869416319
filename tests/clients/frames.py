"""MAVLink frames out of what a tap has kept."""

from typing import NamedTuple

from dialect import mavlink
from steps import Failure, expect


class Frame(NamedTuple):
    time: float
    message: object

    @property
    def source(self):
        return self.message.get_srcSystem(), self.message.get_srcComponent()

    @property
    def target(self):
        return getattr(self.message, "target_system", 0), getattr(self.message, "target_component", 0)

    @property
    def name(self):
        return self.message.get_type()

    @property
    def bytes(self):
        return bytes(self.message.get_msgbuf())


def decode(chunks, whole):
    """Every frame of the stream; with `whole`, none may go beyond its chunk."""
    decoder = mavlink.MAVLink(None)
    decoder.robust_parsing = False
    frames = []
    for at, data in chunks:
        try:
            messages = decoder.parse_buffer(data) or []
        except mavlink.MAVError as error:
            raise Failure(f"{error} in {data.hex()}") from error
        for message in messages:
            expect(not message.get_type().startswith(("BAD_DATA", "UNKNOWN")), f"{message} in {data.hex()}")
            frames.append(Frame(at, message))
        if whole:
            expect(decoder.buf_len() == 0, f"a datagram ends within a frame: {data.hex()}")
    return frames


def commands(frames):
    """The frames that are commands."""
    return [frame for frame in frames if frame.name in ("COMMAND_LONG", "COMMAND_INT")]
