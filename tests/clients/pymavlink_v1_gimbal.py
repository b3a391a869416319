"""A v1 gimbal on pymavlink, over a bad line, steered by a v2 client through the real daemon.

The gimbal is written from ArduPilot's contract for MAVLink gimbals and from PX4's way of driving one, and shares nothing with
gimbald. What goes over its line, either way, is lost and doubled one time in twenty each and up to 50 ms late, by a seed;
still every change of mode is there within three seconds.

Gimbal statement 45. Gimbal statement 46.
"""

import concurrent.futures
import contextlib
import heapq
import itertools
import math
import pathlib
import random
import select
import socket
import tempfile
import threading
import time

from dialect import mavlink
from ground import FOLLOW, LOCK, NAN, GroundStation
from rig import GIMBALD, HOME, HOME_AMSL, LOGS, PITCH_TO_HOME, Process, free_port, get
from steps import Steps, angle_between, expect, wait_for

# Seconds in which every change of mode has to be there.
SOON = 3.0

RETRACT = mavlink.GIMBAL_MANAGER_FLAGS_RETRACT
NEUTRAL = mavlink.GIMBAL_MANAGER_FLAGS_NEUTRAL
RC_EXCLUSIVE = mavlink.GIMBAL_MANAGER_FLAGS_RC_EXCLUSIVE

MODE_RETRACT, MODE_NEUTRAL, MODE_ANGLES, MODE_RC = 0, 1, 2, 3


class BadLine:
    """One way of a line that loses, doubles and delays datagrams."""

    LOSS = 0.05
    DOUBLING = 0.05
    JITTER = 0.05

    def __init__(self, seed):
        self._random = random.Random(seed)
        self._numbers = itertools.count()
        self._on_the_way = []
        self.lost = self.doubled = self.passed = 0

    def put(self, now, data):
        if self._random.random() < self.LOSS:
            self.lost += 1
            return
        self.passed += 1
        copies = 1
        if self._random.random() < self.DOUBLING:
            self.doubled += 1
            copies = 2
        for _ in range(copies):
            due = now + self._random.uniform(0, self.JITTER)
            heapq.heappush(self._on_the_way, (due, next(self._numbers), data))

    def take(self, now):
        while self._on_the_way and self._on_the_way[0][0] <= now:
            yield heapq.heappop(self._on_the_way)[2]


class Axis:
    """Turns to where it is told, no faster than it can."""

    SLEW = 150.0

    def __init__(self):
        self.angle = self.target = 0.0

    def carry_on(self, passed):
        most = self.SLEW * passed
        self.angle += max(-most, min(most, self.target - self.angle))


class V1Gimbal:
    """`with V1Gimbal(port, seed) as gimbal:` waits on a UDP port for a vehicle, and then does what the contract says."""

    COMPONENT = mavlink.MAV_COMP_ID_GIMBAL
    # Where it goes by itself: to its stow, and to where the stick of its own radio control stands.
    STOWED = (-80.0, 0.0)
    STICK = (-12.0, 8.0)

    def __init__(self, port, seed, sign=1.0, needs_configuring=False, reports_status=False):
        """`sign` of pitch and yaw in what it is told; whether 205 needs a 204 before it, and is answered."""
        self._sign = sign
        self._needs_configuring = needs_configuring
        self._reports_status = reports_status
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", port))
        self._daemon = None
        self.inward, self.outward = BadLine(seed), BadLine(seed + 1)
        # MAVLink's packer writes here.
        self._mav = mavlink.MAVLink(self, srcSystem=0, srcComponent=self.COMPONENT)
        self._decoder = mavlink.MAVLink(None)
        self._lock = threading.Lock()
        self.vehicle = None
        self.is_broken = None
        self._heard_vehicle_at = None
        # How often it has said that it is ready.
        self.said_ready = 0
        self._pitch, self._yaw = Axis(), Axis()
        self._mode, self._configured = None, None
        self._attitudes = []
        self._parameters = {"GMB_TILT_MIN": -90.0, "GMB_TILT_MAX": 30.0, "GMB_SPEED": 150.0}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join(5)
        self._socket.close()

    def pose(self):
        """Pitch, yaw from the nose, and the mode: the truth."""
        with self._lock:
            return self._pitch.angle, self._yaw.angle, self._mode

    def heading(self):
        """As the vehicle tells it, degrees."""
        with self._lock:
            return math.degrees(self._attitudes[-1][1].yaw) if self._attitudes else None

    def attitudes(self, since):
        with self._lock:
            return [message for at, message in self._attitudes if at >= since]

    def parameter(self, name):
        with self._lock:
            return self._parameters[name]

    def write(self, data):
        """What the packer has packed."""
        self.outward.put(time.monotonic(), bytes(data))

    def _run(self):
        try:
            last = beat_at = report_at = time.monotonic()
            while not self._stop.is_set():
                if select.select([self._socket], [], [], 0.002)[0]:
                    data, self._daemon = self._socket.recvfrom(65536)
                    self.inward.put(time.monotonic(), data)
                now = time.monotonic()
                with self._lock:
                    for data in self.inward.take(now):
                        for message in self._decoder.parse_buffer(data) or []:
                            self._hear(now, message)
                    for axis in (self._pitch, self._yaw):
                        axis.carry_on(now - last)
                    last = now
                    if self.vehicle and now >= beat_at:
                        beat_at = now + 1.0
                        self._beat(now)
                    if self.vehicle and now >= report_at:
                        report_at = now + (0.25 if self._reports_status else 0.1)
                        self._report(now)
                for data in self.outward.take(now):
                    self._socket.sendto(data, self._daemon)
        except Exception as error:  # seen by the script, which else would wait for a dead gimbal
            self.is_broken = f"{type(error).__name__}: {error}"
            raise

    def _beat(self, now):
        # "ACTIVE only when ready for angle targets."
        ready = now - self._heard_vehicle_at > 1.0
        state = mavlink.MAV_STATE_ACTIVE if ready else mavlink.MAV_STATE_BOOT
        self.said_ready += ready
        self._mav.heartbeat_send(mavlink.MAV_TYPE_GIMBAL, mavlink.MAV_AUTOPILOT_GENERIC, 0, 0, state)

    def _report(self, now):
        pitch, yaw = self._pitch.angle, self._yaw.angle
        if self._reports_status:
            self._mav.mount_status_send(0, 0, round(pitch * 100), 0, round(yaw * 100))
        else:
            self._mav.mount_orientation_send(int(now * 1000) % 2**32, 0, pitch, yaw)

    def _hear(self, now, message):
        kind = message.get_type()
        source = (message.get_srcSystem(), message.get_srcComponent())
        if kind == "HEARTBEAT":
            # "Ignore type 6 (GCS); accept 1 (fixed wing), 2 (quad) and other vehicle types. … Adopt that sysid."
            if self.vehicle is None and message.type in (1, 2, 3, 4, 10, 13, 14, 15):
                self.vehicle, self._heard_vehicle_at = source, now
                self._mav.srcSystem = source[0]
                for stream, rate in ((mavlink.MAV_DATA_STREAM_EXTRA1, 10), (mavlink.MAV_DATA_STREAM_POSITION, 2)):
                    # The line may lose it.
                    for _ in range(3):
                        self._mav.request_data_stream_send(*source, stream, rate, 1)
            return
        if kind == "ATTITUDE" and source == self.vehicle:
            self._attitudes.append((now, message))
            return
        if self.vehicle is None:
            return
        target = (getattr(message, "target_system", None), getattr(message, "target_component", None))
        if target not in ((self.vehicle[0], self.COMPONENT), (self.vehicle[0], 0), (0, 0)):
            return
        if kind == "COMMAND_LONG":
            self._handle_command(message, source)
        elif kind == "PARAM_REQUEST_LIST":
            for name in sorted(self._parameters):
                self._tell_parameter(name)
        elif kind == "PARAM_REQUEST_READ" and message.param_id in self._parameters:
            self._tell_parameter(message.param_id)
        elif kind == "PARAM_SET" and message.param_id in self._parameters:
            self._parameters[message.param_id] = message.param_value
            self._tell_parameter(message.param_id)

    def _tell_parameter(self, name):
        names = sorted(self._parameters)
        real = mavlink.MAV_PARAM_TYPE_REAL32
        value = self._parameters[name]
        self._mav.param_value_send(name.encode(), value, real, len(names), names.index(name))

    def _handle_command(self, command, source):
        if command.command == mavlink.MAV_CMD_DO_MOUNT_CONFIGURE:
            self._configured = command.param1
            if self._needs_configuring:
                self._mav.command_ack_send(command.command, mavlink.MAV_RESULT_ACCEPTED, 255, 0, *source)
        elif command.command == mavlink.MAV_CMD_DO_MOUNT_CONTROL:
            if self._needs_configuring and self._configured != command.param7:
                return
            self._mode = command.param7
            if self._mode == MODE_ANGLES:
                expect(abs(command.param1) <= 90 and abs(command.param3) <= 360, f"not degrees: {command}")
                expect(command.param2 == 0, f"a camera that rolls: {command}")
                pose = (self._sign * command.param1, self._sign * command.param3)
            else:
                pose = {MODE_RETRACT: self.STOWED, MODE_NEUTRAL: (0.0, 0.0), MODE_RC: self.STICK}[self._mode]
            self._pitch.target, self._yaw.target = pose


@contextlib.contextmanager
def daemon(name, gimbal_keys):
    """A daemon with a simulated vehicle; gives the ports of the gimbal and of the ground link, and the page."""
    gimbal, autopilot, ground, page = free_port(), free_port(), free_port(), free_port(socket.SOCK_STREAM)
    LOGS.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="gimbald-") as folder:
        config = pathlib.Path(folder) / "gimbald.toml"
        config.write_text(
            f"""
[[link]]
name = "gimbal"
role = "gimbal"
endpoint = "udpout:127.0.0.1:{gimbal}"

[[link]]
name = "autopilot"
role = "autopilot"
endpoint = "udpin:127.0.0.1:{autopilot}"

[[link]]
name = "ground"
role = "ground"
endpoint = "udpin:127.0.0.1:{ground}"

[[gimbal]]
name = "camera"
family = "mavlink_v1"
link = "gimbal"
v1_status = true
{gimbal_keys}

[http]
listen = "127.0.0.1:{page}"
"""
        )
        processes = []
        try:
            for part, *arguments in (
                ("daemon", "--log", "debug", "run", "--config", str(config)),
                ("vehicle", "sim", "vehicle", "--endpoint", f"udpout:127.0.0.1:{autopilot}", "--autopilot", "ardupilot"),
            ):
                log = LOGS / f"v1-gimbal-{name}-{part}.log"
                processes.append(Process(f"gimbald ({part})", [GIMBALD, *arguments], log))
            yield gimbal, ground, f"http://127.0.0.1:{page}"
        finally:
            for process in reversed(processes):
                process.kill()


class Flight:
    """One gimbal, its daemon and a client; each step is a change of mode."""

    def __init__(self, steps, name, gimbal, client):
        self._steps, self._name, self._gimbal, self._client = steps, name, gimbal, client

    def change(self, what, ask, is_there):
        """`ask()`, and within three seconds the gimbal is there by its own word, and stays for a moment."""

        def step():
            started = time.monotonic()
            ask()
            took = self.wait_there(what, is_there, started)
            return f"{took:.2f} s"

        self._steps.run(f"{self._name}: {what}", step)

    def wait_there(self, what, is_there, started):
        since = None
        while True:
            now = time.monotonic()
            expect(self._gimbal.is_broken is None, f"the gimbal broke: {self._gimbal.is_broken}")
            if is_there():
                since = since or now
                if now - since >= 0.2:
                    return since - started
            else:
                since = None
                pose = self._gimbal.pose()
                expect(now - started < SOON, f"{what} not within {SOON:g} s; it is at {pose}")
            time.sleep(0.01)

    def is_at(self, pitch, yaw, mode, within=1.0):
        def is_there():
            told_pitch, told_yaw, told_mode = self._gimbal.pose()
            near = abs(told_pitch - pitch) <= within and angle_between(told_yaw, yaw) <= within
            return near and told_mode == mode

        return is_there

    def is_north_of(self, pitch, yaw_north, within):
        """At a yaw from North; the heading is as old as the line makes it."""

        def is_there():
            told_pitch, told_yaw, told_mode = self._gimbal.pose()
            heading = self._gimbal.heading()
            if heading is None or told_mode != MODE_ANGLES or abs(told_pitch - pitch) > within:
                return False
            return angle_between(told_yaw + heading, yaw_north) <= within

        return is_there

    def flag(self, flag):
        """Whether the client sees it in the attitude of the gimbal."""
        status = self._client.last("GIMBAL_DEVICE_ATTITUDE_STATUS")
        return bool(status and status.flags & flag)

    def fly(self):
        client, accept = self._client, self._client.accepted
        gimbal = self._gimbal

        def pitchyaw(*angles, **how):
            result = client.pitchyaw(*angles, **how)
            expect(result == mavlink.MAV_RESULT_ACCEPTED, f"result {result}")

        def found():
            wait_for("the gimbal in its manager's words", lambda: client.last("GIMBAL_MANAGER_INFORMATION"), 10)
            information = client.request(283, "GIMBAL_DEVICE_INFORMATION")
            expect(information.gimbal_device_id == 1, f"device {information.gimbal_device_id}")
            wait_for("an attitude", lambda: client.last("GIMBAL_DEVICE_ATTITUDE_STATUS"), 3)
            wait_for("a heading at the gimbal", lambda: gimbal.heading() is not None, 5)
            # Before it has heard that, the daemon refuses for the time being, and two of them may get lost.
            wait_for("the gimbal's word that it is ready", lambda: gimbal.said_ready >= 3, 8)
            time.sleep(BadLine.JITTER)
            pose = gimbal.pose()
            expect(pose == (0.0, 0.0, None), f"it was moved before anybody asked: {pose}")

        self._steps.run(f"{self._name}: found, and told nothing", found, essential=True)
        self.change("angles", lambda: pitchyaw(-30, 20), self.is_at(-30, 20, MODE_ANGLES))
        self.change("a yaw from North", lambda: pitchyaw(-20, -170, flags=LOCK), self.is_north_of(-20, -170, 3.0))
        self.change("a yaw from the nose again", lambda: pitchyaw(-20, -60), self.is_at(-20, -60, MODE_ANGLES))

        def turns(rate):
            def is_there():
                before = gimbal.pose()[0]
                time.sleep(0.3)
                return abs((gimbal.pose()[0] - before) / 0.3 - rate) < max(2.5, abs(rate) / 3)

            return is_there

        self.change("a rate", lambda: pitchyaw(NAN, NAN, -10, 0), turns(-10))
        self.change("the end of a rate", lambda: pitchyaw(NAN, NAN, 0, 0), turns(0))
        self._steps.run(f"{self._name}: a rate that nobody refreshes", self.rate_ends)
        self.change("neutral", lambda: pitchyaw(NAN, NAN, flags=FOLLOW | NEUTRAL), self.is_at(0, 0, MODE_NEUTRAL))
        self.change("retract", lambda: pitchyaw(NAN, NAN, flags=RETRACT), self.is_at(*gimbal.STOWED, MODE_RETRACT))
        self.change("angles from retract", lambda: pitchyaw(-45, 30), self.is_at(-45, 30, MODE_ANGLES))

        def at_home():
            pitch, _, mode = gimbal.pose()
            return mode == MODE_ANGLES and abs(pitch - PITCH_TO_HOME) <= 2.0

        latitude, longitude = HOME
        roi = mavlink.MAV_CMD_DO_SET_ROI_LOCATION
        place = (0, round(latitude * 1e7), round(longitude * 1e7))
        self.change("a place", lambda: accept(roi, 1, NAN, NAN, NAN, HOME_AMSL, as_int=place), at_home)
        self.change("home again", lambda: accept(mavlink.MAV_CMD_DO_SET_ROI_NONE, 1), self.is_at(0, 0, MODE_NEUTRAL))
        mount = mavlink.MAV_CMD_DO_MOUNT_CONTROL
        self.change("the place of home in the way of v1", lambda: accept(mount, 0, 0, 0, 0, 0, 0, 6), at_home)

        def by_radio():
            return self.is_at(*gimbal.STICK, MODE_RC)() and self.flag(RC_EXCLUSIVE)

        self.change("radio control", lambda: pitchyaw(NAN, NAN, flags=FOLLOW | RC_EXCLUSIVE), by_radio)

        def taken_back():
            return self.is_at(-60, -30, MODE_ANGLES)() and not self.flag(RC_EXCLUSIVE)

        self.change("angles from radio control", lambda: pitchyaw(-60, -30), taken_back)
        self._steps.run(f"{self._name}: the client sees what is", self.client_sees)
        self._steps.run(f"{self._name}: parameters through the daemon", self.parameters)
        self._steps.run(f"{self._name}: the attitude that the gimbal asked for", self.streams)

    def rate_ends(self):
        """A streamed rate ends two seconds after its last message (`rate_timeout_s`)."""
        before = self._gimbal.pose()[0]
        for _ in range(5):
            self._client.set_pitchyaw(pitch_rate=10, yaw_rate=0)
            time.sleep(0.1)
        time.sleep(3)
        turned = self._gimbal.pose()[0]
        time.sleep(0.5)
        expect(abs(self._gimbal.pose()[0] - turned) < 0.3, "it turns on")
        expect(18 < turned - before < 30, f"{turned - before:.1f}° in two and a half seconds")

    def client_sees(self):
        """Of v2: a true frame bit and the angles. Of v1: the same in hundredths and in degrees."""
        pitch, yaw, _ = self._gimbal.pose()
        started = time.monotonic()

        def near(*angles):
            return abs(angles[0] - pitch) < 1 and angle_between(angles[1], yaw) < 1

        def v2():
            seen = self._client.attitudes.since(started)
            return seen and near(seen[-1].pitch, seen[-1].yaw_vehicle)

        def manager(name, angles):
            def last():
                return [message for _, message in self._client.heard(name, source=(1, 191), since=started)[-1:]]

            # The first may have been on its way before.
            wait_for(
                lambda: f"{name} of the manager at {pitch:.1f} {yaw:.1f}; the last: {last()}",
                lambda: any(near(*angles(told)) for told in last()),
                2,
            )

        wait_for("the attitude in 285", v2, 1)
        manager("MOUNT_STATUS", lambda told: (told.pointing_a / 100, told.pointing_c / 100))
        manager("MOUNT_ORIENTATION", lambda told: (told.pitch, told.yaw))
        last = self._client.last("GIMBAL_DEVICE_ATTITUDE_STATUS")
        frames = last.flags & (32 | 64)
        expect(frames == 32, f"frame bits {frames}")

    def parameters(self):
        """Asked again when the line loses it, as every client does."""
        client, gimbal = self._client, self._gimbal
        target = (1, gimbal.COMPONENT)

        def heard(name, value=None):
            values = client.heard("PARAM_VALUE", source=target, since=started)
            return [at for at, told in values if told.param_id == name and value in (None, told.param_value)]

        def until(what, ask, is_done):
            for _ in range(20):
                ask()
                try:
                    return wait_for(what, is_done, 0.25)
                except Exception:
                    continue
            return wait_for(what, is_done, 0)

        started = time.monotonic()
        names = ("GMB_TILT_MIN", "GMB_TILT_MAX", "GMB_SPEED")
        until(
            "all parameters",
            lambda: client.send("param_request_list_send", *target),
            lambda: all(heard(name) for name in names),
        )
        real = mavlink.MAV_PARAM_TYPE_REAL32
        until(
            "a parameter that was set",
            lambda: client.send("param_set_send", *target, b"GMB_TILT_MAX", 25.0, real),
            lambda: heard("GMB_TILT_MAX", 25.0),
        )
        expect(gimbal.parameter("GMB_TILT_MAX") == 25.0, "it was not set")

    def streams(self):
        """Ten a second were asked for; one in twenty is lost, one in twenty comes twice."""
        seconds = 3.0
        started = time.monotonic()
        time.sleep(seconds)
        rate = len(self._gimbal.attitudes(started)) / seconds
        expect(8 <= rate <= 12, f"{rate:.1f} Hz")
        return f"{rate:.1f} Hz"


# Each with its own habits: as ArduPilot's contract has it; as a STorM32 set up for ArduPilot; as PX4's receivers want it.
GIMBALS = {
    "by the contract": ({}, ""),
    "reversed": ({"sign": -1.0, "reports_status": True}, 'v1_sign = "reversed"'),
    "configured": ({"needs_configuring": True}, "v1_configure = true"),
}


def flight(steps, number, name, habits, keys):
    keys += '\nv1_radio_control = "mode"'
    with daemon(name.replace(" ", "-"), keys) as (gimbal_port, ground_port, page):
        # The daemon speaks first, to a port that may not be there yet.
        with V1Gimbal(gimbal_port, seed=100 * number, **habits) as gimbal:
            wait_for("the daemon's page", lambda: is_up(page), 10)
            with GroundStation(ground_port, 240 + number, device=1, speaker=191) as client:
                Flight(steps, name, gimbal, client).fly()
                steps.run(f"{name}: the line was bad", lambda: was_bad(gimbal))


def is_up(page):
    try:
        return get(f"{page}/healthz")[0] == 200
    except OSError:
        return False


def was_bad(gimbal):
    for line in (gimbal.inward, gimbal.outward):
        expect(line.lost > 0 and line.doubled > 0, f"{line.lost} lost, {line.doubled} doubled of {line.passed}")
    return f"lost {gimbal.inward.lost} + {gimbal.outward.lost}"


def body(steps):
    with concurrent.futures.ThreadPoolExecutor() as pool:
        flights = [
            pool.submit(flight, steps, number, name, habits, keys)
            for number, (name, (habits, keys)) in enumerate(GIMBALS.items())
        ]
        for one in flights:
            one.result()


if __name__ == "__main__":
    steps = Steps("v1 gimbal")
    steps.script(lambda: body(steps))
