"""ArduPilot with `MNT1_TYPE` 6 on pymavlink: it drives the gimbal device that the real daemon presents to it.

Written from what was observed of ArduPilot, and shares nothing with gimbald: it waits for the heartbeat of a gimbal on component
154, asks that for 283 once a second, and then sends 286 and 284 fifty times a second whether or not anything changed. It is a
gimbal manager too, and says so to everybody.
"""

import contextlib
import math
import pathlib
import socket
import tempfile
import threading
import time

from attitudes import angles_of
from dialect import mavlink
from ground import FOLLOW, LOCK, NAN, GroundStation, quaternion
from rig import GIMBALD, LOGS, Process, free_port, get
from steps import Steps, angle_between, expect, wait_for

DEVICE = mavlink.MAV_COMP_ID_GIMBAL
MANAGER = 191
ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
YAW_IN_VEHICLE_FRAME = mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_VEHICLE_FRAME
YAW_IN_EARTH_FRAME = mavlink.GIMBAL_DEVICE_FLAGS_YAW_IN_EARTH_FRAME

# Degrees from North.
HEADING = 40.0


class ArduPilot:
    """`with ArduPilot(port) as autopilot:` flies level to one heading, and points its mount where it is told."""

    PERIOD = 0.02

    def __init__(self, port):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        self._socket.settimeout(0.002)
        self._mav = mavlink.MAVLink(self, srcSystem=1, srcComponent=mavlink.MAV_COMP_ID_AUTOPILOT1)
        self._decoder = mavlink.MAVLink(None)
        self._lock = threading.Lock()
        self._aim = (quaternion(-30, 0), (NAN,) * 3, 0)
        self._heard = []
        self.error = None
        self.is_rival = False
        self.found_after = None
        self.information = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._started = time.monotonic()
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join(5)
        self._socket.close()

    def write(self, data):
        """For MAVLink's packer."""
        with contextlib.suppress(ConnectionRefusedError):
            self._socket.send(bytes(data))

    def point(self, pitch, yaw, locked=False):
        """Yaw from the nose, or from North; ArduPilot sets all lock bits or none, and no frame bit."""
        with self._lock:
            self._aim = (quaternion(pitch, yaw), (NAN,) * 3, LOCK if locked else 0)

    def turn(self, pitch_rate):
        with self._lock:
            self._aim = ((NAN,) * 4, (0.0, math.radians(pitch_rate), 0.0), FOLLOW)

    def stop_streaming(self):
        with self._lock:
            self._aim = None

    def heard(self, name, component, since=0.0):
        """What that component of the vehicle said."""
        with self._lock:
            heard = list(self._heard)
        return [
            message
            for at, message in heard
            if at >= since and message.get_type() == name and message.get_srcComponent() == component
        ]

    def _run(self):
        beat_at = stream_at = ask_at = attitude_at = 0.0
        while not self._stop.is_set():
            now = time.monotonic()
            if now >= beat_at:
                beat_at = now + 1.0
                self._mav.heartbeat_send(
                    mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 81, 0, mavlink.MAV_STATE_ACTIVE
                )
            boot_ms = int((now - self._started) * 1000)
            if now >= attitude_at:
                attitude_at = now + 0.1
                self._mav.attitude_send(boot_ms, 0, 0, math.radians(HEADING), 0, 0, 0)
                if self.is_rival:
                    self._mav.gimbal_manager_status_send(boot_ms, 0, 1, 0, 0, 0, 0)
                    told = (0, 0, boot_ms, YAW_IN_VEHICLE_FRAME, quaternion(80, 80), NAN, NAN, NAN, 0, NAN, NAN, 1)
                    self._mav.gimbal_device_attitude_status_send(*told)
            if self.found_after is not None and self.information is None and now >= ask_at:
                ask_at = now + 1.0
                asked = mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_INFORMATION
                self._mav.command_long_send(1, DEVICE, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, asked, 0, 0, 0, 0, 0, 0)
            if self.information is not None and now >= stream_at:
                stream_at = max(stream_at + self.PERIOD, now - 0.1)
                self._stream(boot_ms)
            self._receive()

    def _stream(self, boot_ms):
        with self._lock:
            aim = self._aim
        state = mavlink.ESTIMATOR_ATTITUDE
        q = quaternion(0, HEADING)
        self._mav.autopilot_state_for_gimbal_device_send(1, 0, boot_ms * 1000, q, 0, 0, 0, 0, 0, 0, state, 0, 0.0)
        if aim is not None:
            q, rates, flags = aim
            self._mav.gimbal_device_set_attitude_send(1, DEVICE, flags, q, *rates)

    def _receive(self):
        try:
            data = self._socket.recv(65536)
        except (TimeoutError, ConnectionRefusedError):
            return
        try:
            messages = self._decoder.parse_buffer(data) or []
        except mavlink.MAVError as error:
            self.error = f"undecodable: {error}"
            return
        for message in messages:
            with self._lock:
                self._heard.append((time.monotonic(), message))
            self._hear(message)

    def _hear(self, message):
        is_device = (message.get_srcSystem(), message.get_srcComponent()) == (1, DEVICE)
        if message.get_type() == "HEARTBEAT" and is_device and message.type == mavlink.MAV_TYPE_GIMBAL:
            if self.found_after is None:
                self.found_after = time.monotonic() - self._started
        elif message.get_type() == "GIMBAL_DEVICE_INFORMATION" and is_device:
            self.information = message
        elif message.get_type() == "COMMAND_LONG" and message.target_component == 1:
            self._mav.command_ack_send(message.command, ACCEPTED)


def body(steps, autopilot, station):
    camera = station.attitudes

    def finds():
        wait_for("a gimbal on component 154", lambda: autopilot.found_after is not None, 8)
        information = wait_for("its 283", lambda: autopilot.information, 5)
        expect(information.model_name == "Simulated v2", f"its model is {information.model_name!r}")
        expect(information.gimbal_device_id == 0, f"its device id is {information.gimbal_device_id}")
        takes_places = mavlink.GIMBAL_MANAGER_CAP_FLAGS_CAN_POINT_LOCATION_GLOBAL
        expect(information.cap_flags2 & takes_places, f"capabilities {information.cap_flags2:#x}")
        return f"after {autopilot.found_after:.1f} s"

    def hears_attitudes():
        started = time.monotonic()
        time.sleep(2)
        told = autopilot.heard("GIMBAL_DEVICE_ATTITUDE_STATUS", DEVICE, started)
        expect(16 <= len(told) <= 24, f"{len(told)} in two seconds")
        frames = {message.flags & (YAW_IN_VEHICLE_FRAME | YAW_IN_EARTH_FRAME) for message in told}
        expect(frames == {YAW_IN_VEHICLE_FRAME}, f"frames {frames}")

    def moves_nothing_unasked():
        camera.expect_still(3, pitch=0, yaw_vehicle=0)

    def points():
        for pitch, yaw, locked, from_nose in [(-45, 30, False, 30), (-10, 100, True, 60), (-20, -15, False, -15)]:
            autopilot.point(pitch, yaw, locked)
            camera.wait_at(pitch=pitch, yaw_vehicle=from_nose)
            seen = autopilot.heard("GIMBAL_DEVICE_ATTITUDE_STATUS", DEVICE)[-1]
            _, told_pitch, told_yaw = angles_of(seen.q)
            near = angle_between(told_pitch, pitch) < 3 and angle_between(told_yaw, from_nose) < 3
            expect(near, f"it is told {told_pitch:.1f}, {told_yaw:.1f}")

    def leaves_a_station_alone():
        expect(station.configure(station.ids) == ACCEPTED, "configure")
        station.wait_owner(station.ids)
        expect(station.pitchyaw(-60, 10) == ACCEPTED, "pitchyaw")
        camera.wait_at(pitch=-60, yaw_vehicle=10)
        camera.expect_still(4, pitch=-60, yaw_vehicle=10)
        station.wait_owner(station.ids)

    def borrows():
        autopilot.point(-30, -25)
        camera.wait_at(pitch=-30, yaw_vehicle=-25)
        station.wait_owner((1, 1))
        expect(station.pitchyaw(-60, 10) == DENIED, "the station was obeyed")

    def gives_back():
        station.wait_owner(station.ids, timeout=6)
        camera.expect_still(3, pitch=-30, yaw_vehicle=-25)
        expect(station.pitchyaw(-60, 10) == ACCEPTED, "pitchyaw")
        camera.wait_at(pitch=-60, yaw_vehicle=10)

    def rates_end_with_the_stream():
        expect(station.configure((-3, -3)) == ACCEPTED, "release")
        autopilot.turn(8)
        time.sleep(1)
        rate = camera.rate("pitch", 1.5)
        expect(6 <= rate <= 10, f"{rate:.1f} °/s")
        autopilot.stop_streaming()
        camera.wait_still("pitch", 4)

    def is_no_second_manager():
        autopilot.is_rival = True
        started = time.monotonic()
        time.sleep(3)
        managers = {message.get_srcComponent() for _, message in station.heard("GIMBAL_MANAGER_STATUS", since=started)}
        gimbals = {
            message.get_srcComponent()
            for _, message in station.heard("GIMBAL_DEVICE_ATTITUDE_STATUS", since=started)
        }
        expect((managers, gimbals) == ({MANAGER}, {DEVICE}), f"managers {managers}, gimbals {gimbals}")
        expect(autopilot.error is None, autopilot.error)
        station.check()

    steps.run("finds the device and what it is", finds, essential=True)
    steps.run("hears its attitude from the nose, ten times a second", hears_attitudes)
    steps.run("its stream moves nothing that nobody asked for", moves_nothing_unasked)
    steps.run("a new demand is followed, from the nose and from North", points)
    steps.run("a station that takes control keeps it", leaves_a_station_alone)
    steps.run("a new demand borrows control", borrows)
    steps.run("control goes back to the station", gives_back)
    steps.run("rates end with the stream", rates_end_with_the_stream)
    steps.run("the station sees one manager and one gimbal", is_no_second_manager)


def main():
    steps = Steps("ArduPilot")

    def everything():
        LOGS.mkdir(parents=True, exist_ok=True)
        autopilot_port, gimbal_port, ground_port = free_port(), free_port(), free_port()
        listen = f"127.0.0.1:{free_port(socket.SOCK_STREAM)}"
        with tempfile.TemporaryDirectory(prefix="gimbald-") as folder, contextlib.ExitStack() as stack:
            config = pathlib.Path(folder) / "gimbald.toml"
            links = [("gimbal", gimbal_port), ("autopilot", autopilot_port), ("ground", ground_port)]
            config.write_text(
                "".join(
                    f'[[link]]\nname = "{role}"\nrole = "{role}"\nendpoint = "udpin:127.0.0.1:{port}"\n'
                    for role, port in links
                )
                + f'[autopilot]\npresent_device = true\n[http]\nlisten = "{listen}"\n'
            )
            for part, arguments in (
                ("daemon", ("--log", "debug", "run", "--config", str(config))),
                ("gimbal", ("sim", "gimbal", "--endpoint", f"udpout:127.0.0.1:{gimbal_port}", "--frames", "strict")),
            ):
                log = LOGS / f"ardupilot-{part}.log"
                process = Process(f"gimbald ({part})", [GIMBALD, *arguments], log)
                stack.callback(process.kill)

            def is_up():
                try:
                    return get(f"http://{listen}/healthz")[0] == 200
                except OSError:
                    return False

            wait_for("the daemon's page", is_up, 10)
            autopilot = stack.enter_context(ArduPilot(autopilot_port))
            station = stack.enter_context(GroundStation(ground_port, 250))
            body(steps, autopilot, station)

    steps.script(everything)


if __name__ == "__main__":
    main()
