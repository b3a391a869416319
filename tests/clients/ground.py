"""A small ground station on pymavlink, for scripts that speak raw MAVLink."""

import math
import threading
import time
from collections import defaultdict

from attitudes import Attitudes
from dialect import mavlink, mavutil
from steps import Failure, expect, wait_for

NAN = math.nan

# Flags of setpoints.
FOLLOW = mavlink.GIMBAL_MANAGER_FLAGS_ROLL_LOCK | mavlink.GIMBAL_MANAGER_FLAGS_PITCH_LOCK
LOCK = FOLLOW | mavlink.GIMBAL_MANAGER_FLAGS_YAW_LOCK
YAW_IN_VEHICLE_FRAME = mavlink.GIMBAL_MANAGER_FLAGS_YAW_IN_VEHICLE_FRAME
YAW_IN_EARTH_FRAME = mavlink.GIMBAL_MANAGER_FLAGS_YAW_IN_EARTH_FRAME


def quaternion(pitch_deg, yaw_deg):
    """w, x, y, z of yaw, then pitch."""
    p, y = math.radians(pitch_deg) / 2, math.radians(yaw_deg) / 2
    return [
        math.cos(y) * math.cos(p),
        -math.sin(y) * math.sin(p),
        math.cos(y) * math.sin(p),
        math.sin(y) * math.cos(p),
    ]


class GroundStation:
    """Sends HEARTBEAT, hears everything, and fails on whatever it cannot decode."""

    def __init__(self, port, system_id, vehicle=1, manager=191, device=154, speaker=None):
        """`speaker` is the component that tells the gimbal's attitude, where that is not the gimbal's own."""
        self.ids = (system_id, mavlink.MAV_COMP_ID_MISSIONPLANNER)
        self._vehicle, self._manager, self._device = vehicle, manager, device
        self._speaker = device if speaker is None else speaker
        self._connection = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{port}", source_system=system_id, source_component=self.ids[1], robust_parsing=False
        )
        self.attitudes = Attitudes()
        self._sending = threading.Lock()
        self._heard = threading.Lock()
        self._messages = defaultdict(list)
        self._error = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join(5)
        self._connection.close()

    def _run(self):
        beat_at = 0.0
        while not self._stop.is_set():
            if time.monotonic() >= beat_at:
                beat_at = time.monotonic() + 1.0
                self.send("heartbeat_send", mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4)
            try:
                message = self._connection.recv_match(blocking=True, timeout=0.1)
            except ConnectionRefusedError:
                continue
            except mavlink.MAVError as error:
                self._error = f"undecodable: {error}"
                return
            if message is not None:
                self._hear(message)

    def _hear(self, message):
        with self._heard:
            self._messages[message.get_type()].append((time.monotonic(), message))
        from_device = (message.get_srcSystem(), message.get_srcComponent()) == (self._vehicle, self._speaker)
        if message.get_type() == "GIMBAL_DEVICE_ATTITUDE_STATUS" and from_device:
            self.attitudes.add_status(message)

    def check(self):
        expect(self._error is None, self._error)

    def send(self, name, *fields):
        with self._sending:
            getattr(self._connection.mav, name)(*fields)

    def heard(self, name, source=None, since=0.0):
        """(time, message) of each that fits."""
        with self._heard:
            everything = list(self._messages[name])
        return [
            (at, message)
            for at, message in everything
            if at >= since and source in (None, (message.get_srcSystem(), message.get_srcComponent()))
        ]

    def last(self, name):
        """The newest from the manager or its device; None without any."""
        found = [
            message
            for _, message in self.heard(name)
            if message.get_srcSystem() == self._vehicle and message.get_srcComponent() in (self._manager, self._device)
        ]
        return found[-1] if found else None

    def command(self, command, *parameters, component=None, as_int=None, timeout=1.0):
        """Sends a command to the manager, once, and gives the result that it is answered with.

        `as_int` are frame, x and y of a COMMAND_INT, whose `parameters` are then the first four and z."""
        component = self._manager if component is None else component
        started = time.monotonic()
        if as_int is None:
            padded = list(parameters) + [NAN] * (7 - len(parameters))
            self.send("command_long_send", self._vehicle, component, command, 0, *padded)
        else:
            frame, x, y = as_int
            first, z = parameters[:4], parameters[4]
            self.send("command_int_send", self._vehicle, component, frame, command, 0, 0, *first, x, y, z)

        def answer():
            self.check()
            for at, ack in self.heard("COMMAND_ACK", since=started):
                if ack.command == command and (ack.target_system, ack.target_component) == self.ids:
                    if component in (0, ack.get_srcComponent()):
                        return ack, at
            return None

        ack, _ = wait_for(f"an answer to command {command}", answer, timeout)
        return ack.result

    def accepted(self, command, *parameters, **how):
        result = self.command(command, *parameters, **how)
        if result != mavlink.MAV_RESULT_ACCEPTED:
            raise Failure(f"command {command} {parameters}: {mavlink.enums['MAV_RESULT'][result].name}")

    def request(self, message_id, name, component=None):
        """A message by REQUEST_MESSAGE."""
        started = time.monotonic()
        self.accepted(mavlink.MAV_CMD_REQUEST_MESSAGE, message_id, component=component)
        return wait_for(f"{name} on request", lambda: self.heard(name, since=started), 1)[0][1]

    def configure(self, primary, secondary=(-1, -1)):
        """DO_GIMBAL_MANAGER_CONFIGURE; gives the result."""
        return self.command(
            mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, *primary, *secondary, NAN, NAN, self._device
        )

    def pitchyaw(self, pitch, yaw, pitch_rate=NAN, yaw_rate=NAN, flags=FOLLOW):
        """DO_GIMBAL_MANAGER_PITCHYAW; gives the result."""
        return self.command(
            mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, pitch, yaw, pitch_rate, yaw_rate, flags, NAN, self._device
        )

    def set_pitchyaw(self, pitch=NAN, yaw=NAN, pitch_rate=NAN, yaw_rate=NAN, flags=FOLLOW):
        """The message GIMBAL_MANAGER_SET_PITCHYAW, in degrees."""
        radians = [math.radians(value) for value in (pitch, yaw, pitch_rate, yaw_rate)]
        self.send(
            "gimbal_manager_set_pitchyaw_send", self._vehicle, self._manager, flags, self._device, *radians
        )

    def set_attitude(self, q=(NAN,) * 4, rates=(NAN,) * 3, flags=FOLLOW):
        """The message GIMBAL_MANAGER_SET_ATTITUDE, rates in degrees per second."""
        self.send(
            "gimbal_manager_set_attitude_send",
            self._vehicle,
            self._manager,
            flags,
            self._device,
            list(q),
            *map(math.radians, rates),
        )

    def wait_owner(self, primary, secondary=(0, 0), timeout=1.0):
        def owners():
            status = self.last("GIMBAL_MANAGER_STATUS")
            return status and (
                (status.primary_control_sysid, status.primary_control_compid),
                (status.secondary_control_sysid, status.secondary_control_compid),
            )

        wait_for(
            lambda: f"control by {primary} and {secondary}; it is {owners()}",
            lambda: owners() == (primary, secondary),
            timeout,
        )
