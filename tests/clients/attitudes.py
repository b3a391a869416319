"""What a client sees of the camera's attitude, and when it saw it."""

import math
import threading
import time
from collections import deque
from typing import NamedTuple

from stalls import stalled
from steps import Failure, angle_between, wait_for


class Seen(NamedTuple):
    """Degrees; yaw from the vehicle's nose and from North, each None where the client does not say."""

    # When it came; and when it was so, on a clock that begins anywhere.
    time: float
    clock: float
    pitch: float
    yaw_vehicle: float
    yaw_north: float
    roll: float


# Of GIMBAL_DEVICE_ATTITUDE_STATUS: yaw is from North.
YAW_IN_EARTH_FRAME = 64


def angles_of(q):
    """Roll, pitch and yaw in degrees of w, x, y, z."""
    w, x, y, z = q
    roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return math.degrees(roll), math.degrees(pitch), math.degrees(yaw)


def wrapped(angle):
    """From -180 to 180 degrees."""
    return (angle + 180) % 360 - 180


def slope(seen, axis):
    """How fast `axis` turned, degrees per second."""
    # The slope of the line nearest to all of them: one late arrival does not matter.
    mean_time = sum(one.clock for one in seen) / len(seen)
    turned, total = [0.0], 0.0
    for before, after in zip(seen, seen[1:]):
        total += wrapped(getattr(after, axis) - getattr(before, axis))
        turned.append(total)
    mean_turned = sum(turned) / len(turned)
    spread = sum((one.clock - mean_time) ** 2 for one in seen)
    return sum((one.clock - mean_time) * (angle - mean_turned) for one, angle in zip(seen, turned)) / spread


class Heading:
    """Where the vehicle heads, of its ATTITUDE; one thread tells, another asks."""

    def __init__(self):
        self._last = None

    def add(self, message):
        self._last = (time.monotonic(), math.degrees(message.yaw), math.degrees(message.yawspeed))

    def now(self):
        """Degrees, going on as it last turned; None before the first."""
        if self._last is None:
            return None
        at, heading, rate = self._last
        return wrapped(heading + rate * (time.monotonic() - at))


class Attitudes:
    """Filled by the client's own thread or loop; judged by the script."""

    def __init__(self, arrives_within=6):
        """`arrives_within`: how long the farthest way may take, seconds."""
        self._arrives_within = arrives_within
        self._lock = threading.Lock()
        self._seen = deque(maxlen=2000)
        # From where the last GIMBAL_DEVICE_ATTITUDE_STATUS counted the yaw.
        self.status_yaw = None

    def add(self, pitch, yaw_vehicle=None, yaw_north=None, roll=None, clock=None):
        now = time.monotonic()
        with self._lock:
            self._seen.append(Seen(now, now if clock is None else clock, pitch, yaw_vehicle, yaw_north, roll))

    def add_status(self, message):
        """A GIMBAL_DEVICE_ATTITUDE_STATUS."""
        roll, pitch, yaw = angles_of(message.q)
        heading = math.degrees(message.delta_yaw)
        clock = message.time_boot_ms / 1000
        in_earth_frame = message.flags & YAW_IN_EARTH_FRAME
        self.status_yaw = "yaw_north" if in_earth_frame else "yaw_vehicle"
        if in_earth_frame:
            self.add(pitch, wrapped(yaw - heading), yaw, roll, clock)
        else:
            self.add(pitch, yaw, wrapped(yaw + heading), roll, clock)

    def add_orientation(self, message, heading):
        """A MOUNT_ORIENTATION. Where North is a gimbal may not know, so the vehicle's heading tells it, once it is known."""
        clock = message.time_boot_ms / 1000
        yaw_north = None if heading is None else wrapped(message.yaw + heading)
        self.add(message.pitch, message.yaw, yaw_north, message.roll, clock)

    def since(self, moment):
        with self._lock:
            return [seen for seen in self._seen if seen.time >= moment]

    def last(self):
        """The newest; there has to be one."""
        with self._lock:
            return self._seen[-1]

    def wait_at(self, steady=5, within=1.0, **wanted):
        """Waits until the last few are all at the wanted angles; gives the last one."""

        def last():
            with self._lock:
                return list(self._seen)[-steady:]

        def arrived():
            seen = last()
            near = all(
                angle_between(getattr(one, axis), angle) <= within for one in seen for axis, angle in wanted.items()
            )
            return len(seen) == steady and near

        def missing():
            at = last()[-1:]
            return f"within {within}° of {wanted}; {f'last seen {at[0]}' if at else 'no attitude at all'}"

        wait_for(missing, arrived, self._arrives_within)
        return last()[-1]

    def expect_still(self, seconds, within=1.0, **wanted):
        """Fails if the camera leaves these angles within so many seconds from now."""
        for seen in self.watch(seconds):
            for axis, angle in wanted.items():
                if angle_between(getattr(seen, axis), angle) > within:
                    raise Failure(f"the camera moved from {wanted}: {seen}")

    def watch(self, seconds, least=1):
        """What arrives from now on for so long, and until it is `least` attitudes."""
        started = time.monotonic()
        wait_for(
            lambda: f"{least} attitudes over {seconds} s; there were {len(self.since(started))}",
            lambda: len(seen := self.since(started)) >= least and seen[-1].time - started >= seconds,
            seconds + 5,
        )
        return self.since(started)

    def rates(self, axes, seconds=2.0):
        """How fast each of the `axes` turns, degrees per second, over so long from now on."""
        seen = self.watch(seconds, least=5)
        return [slope(seen, axis) for axis in axes]

    def rate(self, axis, seconds=2.0):
        return self.rates([axis], seconds)[0]

    def wait_still(self, axis, timeout=6):
        """Waits until `axis` has stopped turning."""
        started = time.monotonic()
        while abs(rate := self.rate(axis, 0.5)) > 0.5:
            now = time.monotonic()
            if now - started - stalled(started, now) > timeout:
                raise Failure(f"{axis} still turns at {rate:.2f} °/s after {timeout} s")
