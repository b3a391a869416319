"""The simulated gimbals that a rig may have, and by what a client may tell them apart: their capabilities and their ids."""

import sys
from typing import NamedTuple


class Gimbal(NamedTuple):
    name: str
    # Of `gimbald sim gimbal`.
    options: tuple
    # Of its `[[gimbal]]` entry; without it, it is found by itself.
    family: str = None
    # The manager's component and the gimbal's id, as clients list them.
    ids: tuple = (191, 154)
    vendor: str = "gimbald"
    model: str = "Simulated v2"
    # How near it comes to a yaw from North while the vehicle turns, degrees: one that is turned for it lags behind.
    within_north: float = 1.0
    # From where GIMBAL_DEVICE_ATTITUDE_STATUS counts the yaw of this gimbal; None where that changes.
    status_yaw: str = "yaw_north"
    # How long its farthest way takes, seconds.
    arrives_within: float = 6
    # Where it looks when it is retracted, degrees, pitch and yaw from the nose; None for one that is left without motors.
    stowed: tuple = (0, 0)
    # Its GIMBAL_DEVICE_ATTITUDE_STATUS shows then that it is retracted.
    tells_retract: bool = True
    # More of its `[[gimbal]]` entry.
    entry: str = ""

    @property
    def suffix(self):
        """What the steps with it are called besides."""
        return "" if self is MAVLINK_V2 else f" with {self.name}"

    @property
    def device(self):
        return self.ids[1]

    def settings(self):
        """Its entry in the configuration."""
        return f'[[gimbal]]\nname = "camera"\nlink = "gimbal"\nfamily = "{self.family}"\n{self.entry}' if self.family else ""


def gremsy(generation, retract_allowed=False):
    options = ("--family", "gremsy", "--gremsy-generation", generation)
    # Only the one that is no v2 device needs an id of its own.
    device = {"v1": 1, "v2": 154}[generation]
    # The second generation speaks for itself: from North while yaw is locked, else from the nose.
    status_yaw = {"v1": "yaw_north", "v2": None}[generation]
    entry = "retract_allowed = true\n" if retract_allowed else "stow_pitch_deg = -40\nstow_yaw_deg = 25\n"
    return Gimbal(
        f"gremsy_{generation}" + ("_motors_off" if retract_allowed else ""),
        options,
        "gremsy",
        (191, device),
        "GREMSY",
        "MIO",
        status_yaw=status_yaw,
        # It turns by 30 degrees per second, and by 320 to either side.
        arrives_within=25,
        stowed=None if retract_allowed else (-40, 25),
        # The second generation speaks for itself, and shows the flag only while its motors are off.
        tells_retract=generation == "v1" or retract_allowed,
        entry=entry,
    )


MAVLINK_V2 = Gimbal("mavlink_v2", ("--frames", "strict"))
# With ends so far apart that it need not go all the way round while it is locked and the vehicle turns, and none of them
# ahead.
V1_OPTIONS = ("--family", "mavlink_v1", "--yaw-range", "350")
MAVLINK_V1 = Gimbal("mavlink_v1", V1_OPTIONS, "mavlink_v1", (191, 1), "", "MAVLink v1", 2.5, "yaw_vehicle")

GREMSYS = (gremsy("v1"), gremsy("v2"), gremsy("v2", retract_allowed=True))
ALL = {gimbal.name: gimbal for gimbal in (MAVLINK_V2, MAVLINK_V1, *GREMSYS)}


def chosen():
    """The one that the command line names, by default a v2 device."""
    name = sys.argv[1] if len(sys.argv) > 1 else MAVLINK_V2.name
    if name not in ALL:
        sys.exit(f"{name} is no gimbal; expected one of {', '.join(ALL)}")
    return ALL[name]
