"""pymavlink with MAVLink 2 and every message that it knows."""

import os

os.environ["MAVLINK20"] = "1"
os.environ["MAVLINK_DIALECT"] = "all"

from pymavlink import mavutil  # noqa: E402  (reads the dialect from the environment)

mavlink = mavutil.mavlink

__all__ = ["mavlink", "mavutil"]
