"""A real `gimbald run` between a simulated vehicle and a simulated gimbal, for a real client to talk to.

    gimbal ══pseudo-terminals══ gimbald ──udp── vehicle
                                   ├── udpin ──  clients that speak first
                                   └── udpout ── a client that listens

Both cables pass through here, so that a script can see every byte on them.
"""

import ctypes
import json
import os
import pathlib
import select
import signal
import socket
import subprocess
import tempfile
import threading
import time
import tty
import urllib.error
import urllib.request

from attitudes import Attitudes, Heading
from dialect import mavlink
from frames import decode
from gimbals import MAVLINK_V2
from steps import Failure, wait_for

# The simulated vehicle flies a circle of 40 m around home, 50 m above it, to the right.
HOME = (47.397742, 8.545594)
HOME_AMSL = 488
PITCH_TO_HOME = -51.34
TURN_RATE_DPS = 7.16

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
GIMBALD = os.environ.get("GIMBALD", str(REPOSITORY / "target/release/gimbald"))
LOGS = pathlib.Path(os.environ.get("GIMBALD_LOGS", REPOSITORY / "target/tests-run/clients"))

PR_SET_PDEATHSIG = 1


def free_port(kind=socket.SOCK_DGRAM):
    """A port on the loopback that nobody has at the moment."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def port_is_free(port, kind=socket.SOCK_DGRAM):
    with socket.socket(socket.AF_INET, kind) as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def get(url):
    """The status code and the body of a page."""
    try:
        with urllib.request.urlopen(url, timeout=2) as response:
            return response.status, response.read()
    except urllib.error.HTTPError as error:
        return error.code, error.read()


class Process:
    """A child that does not outlive this script; what it says goes into a log file."""

    def __init__(self, name, arguments, log, **options):
        self.name = name
        self.log = log
        libc = ctypes.CDLL(None)
        options.setdefault("stdin", subprocess.DEVNULL)
        with open(log, "wb") as output:
            self._child = subprocess.Popen(
                arguments,
                stdout=output,
                stderr=subprocess.STDOUT,
                preexec_fn=lambda: libc.prctl(PR_SET_PDEATHSIG, signal.SIGKILL),
                **options,
            )

    def check(self):
        code = self._child.poll()
        if code is not None:
            raise Failure(f"{self.name} ended with code {code}; its log: {self.log}")

    def end(self, timeout=5):
        """Asks it to end, and gives its exit code."""
        self._child.send_signal(signal.SIGTERM)
        try:
            return self._child.wait(timeout)
        except subprocess.TimeoutExpired:
            return self.kill()

    def kill(self):
        self._child.kill()
        return self._child.wait()


class Tap:
    """Something on a thread that passes bytes from side to side and keeps what went by."""

    # A minute of a serial line at full rate, several times over.
    MOST = 50_000

    def __init__(self, hear_peer=None):
        """`hear_peer` gets at once what the peer sends."""
        self._hear_peer = hear_peer
        self._lock = threading.Lock()
        self._from_daemon = []
        self._from_peer = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def start(self):
        self._thread.start()

    def _keep(self, chunks, data):
        with self._lock:
            if len(chunks) < self.MOST:
                chunks.append((time.monotonic(), data))
        if chunks is self._from_peer and self._hear_peer:
            self._hear_peer(data)

    def seen(self):
        """What the daemon sent and what the peer sent, each a list of (time, bytes)."""
        with self._lock:
            return list(self._from_daemon), list(self._from_peer)

    def daemon_said(self, since=0.0):
        """The daemon's frames."""
        return [frame for frame in decode(self.seen()[0], whole=False) if frame.time >= since]

    def peer_said(self, since=0.0):
        """The peer's frames."""
        return [frame for frame in decode(self.seen()[1], whole=False) if frame.time >= since]

    def close(self):
        self._stop.set()
        self._thread.join(5)

    def _run(self):
        while not self._stop.is_set():
            self._pass_on()


class Cable(Tap):
    """Two pseudo-terminals, joined: either end opens like a serial port."""

    def __init__(self, hear_peer=None):
        super().__init__(hear_peer)
        self._daemon, daemon_end = os.openpty()
        self._peer, peer_end = os.openpty()
        # Held open, so that the cable outlives whoever opens its ends.
        self._ends = (daemon_end, peer_end)
        for end in self._ends:
            tty.setraw(end)
        self.daemon_path, self.peer_path = map(os.ttyname, self._ends)
        self.start()

    def _pass_on(self):
        readable, _, _ = select.select([self._daemon, self._peer], [], [], 0.1)
        for near, far, chunks in (
            (self._daemon, self._peer, self._from_daemon),
            (self._peer, self._daemon, self._from_peer),
        ):
            if near in readable:
                data = os.read(near, 4096)
                self._keep(chunks, data)
                while data:
                    data = data[os.write(far, data) :]

    def close(self):
        super().close()
        for descriptor in (self._daemon, self._peer, *self._ends):
            os.close(descriptor)


class Wire(Tap):
    """A UDP path between the daemon and one peer. One of them listens on a port; the other sends to `port`."""

    def __init__(self, daemon_port=None, peer_port=None, hear_peer=None):
        super().__init__(hear_peer)
        # Who has no port yet has it when it is first heard.
        self._addresses = {}
        self._daemon = self._open(daemon_port)
        self._peer = self._open(peer_port)
        self.port = (self._peer if peer_port is None else self._daemon).getsockname()[1]
        self.start()

    def _open(self, far_port):
        end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        end.bind(("127.0.0.1", 0))
        self._addresses[end] = far_port and ("127.0.0.1", far_port)
        return end

    def _pass_on(self):
        readable, _, _ = select.select([self._daemon, self._peer], [], [], 0.1)
        for near, far, chunks in (
            (self._daemon, self._peer, self._from_daemon),
            (self._peer, self._daemon, self._from_peer),
        ):
            if near in readable:
                data, self._addresses[near] = near.recvfrom(65536)
                self._keep(chunks, data)
                if self._addresses[far]:
                    far.sendto(data, self._addresses[far])

    def close(self):
        super().close()
        self._daemon.close()
        self._peer.close()


class Rig:
    """`with Rig("name") as rig:` gives a daemon that has found its vehicle and gimbal."""

    def __init__(self, name, system_id=1, autopilot="px4", settings="", gimbal=MAVLINK_V2):
        self._name = name if gimbal is MAVLINK_V2 else f"{name}-{gimbal.name}"
        self.kind = gimbal
        self._system_id = system_id
        self._autopilot = autopilot
        self._settings = settings
        self._processes = []
        self._wires = []
        # Where the camera looks, by the gimbal's own word on its cable.
        self.camera = Attitudes(gimbal.arrives_within)
        self._camera_decoder = mavlink.MAVLink(None)
        self._camera_decoder.robust_parsing = True
        # Where the vehicle heads, by its own word.
        self._heading = Heading()
        self._vehicle_decoder = mavlink.MAVLink(None)
        self._vehicle_decoder.robust_parsing = True
        self.ground_port = free_port()
        # Where the daemon's messages go unasked, by way of `listener`.
        self.listener_port = free_port()
        self._listen = f"127.0.0.1:{free_port(socket.SOCK_STREAM)}"
        self.http = f"http://{self._listen}"

    def __enter__(self):
        LOGS.mkdir(parents=True, exist_ok=True)
        self._folder = tempfile.TemporaryDirectory(prefix="gimbald-")
        autopilot_port = free_port()
        self.cable = Cable(self._see)
        self.wire = self._lay(Wire(autopilot_port, hear_peer=self._see_vehicle))
        self.listener = self._lay(Wire(peer_port=self.listener_port))
        config = pathlib.Path(self._folder.name) / "gimbald.toml"
        config.write_text(
            f"""
[[link]]
name = "gimbal"
role = "gimbal"
endpoint = "serial:{self.cable.daemon_path}:115200"

[[link]]
name = "autopilot"
role = "autopilot"
endpoint = "udpin:127.0.0.1:{autopilot_port}"

[[link]]
name = "ground"
role = "ground"
endpoint = "udpin:127.0.0.1:{self.ground_port}"

[[link]]
name = "listener"
role = "ground"
endpoint = "udpout:127.0.0.1:{self.listener.port}"

[http]
listen = "{self._listen}"

{self._settings}
{self.kind.settings()}
"""
        )
        system_id = str(self._system_id)
        vehicle = ["--endpoint", f"udpout:127.0.0.1:{self.wire.port}", "--autopilot", self._autopilot]
        gimbal = ["--endpoint", f"serial:{self.cable.peer_path}:115200", *self.kind.options]
        try:
            self.daemon = self._start("daemon", "--log", "debug", "run", "--config", str(config))
            self._start("vehicle", "sim", "vehicle", "--system-id", system_id, *vehicle)
            self._start("gimbal", "sim", "gimbal", "--system-id", system_id, *gimbal)
            wait_for("vehicle and gimbal known to the daemon", self._is_ready, 20)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        for process in reversed(self._processes):
            process.kill()
        self.cable.close()
        for wire in self._wires:
            wire.close()
        self._folder.cleanup()

    def _lay(self, wire):
        self._wires.append(wire)
        return wire

    def ground_wire(self):
        """A path of its own to the daemon for a client that sends to its `port`."""
        return self._lay(Wire(self.ground_port))

    def _see(self, data):
        for message in self._camera_decoder.parse_buffer(data) or []:
            if message.get_type() == "GIMBAL_DEVICE_ATTITUDE_STATUS":
                self.camera.add_status(message)
            elif message.get_type() == "MOUNT_ORIENTATION":
                self.camera.add_orientation(message, self._heading.now())

    def _see_vehicle(self, data):
        for message in self._vehicle_decoder.parse_buffer(data) or []:
            if message.get_type() == "ATTITUDE":
                self._heading.add(message)

    def _start(self, part, *arguments):
        process = Process(f"gimbald ({part})", [GIMBALD, *arguments], LOGS / f"{self._name}-{part}.log")
        self._processes.append(process)
        return process

    def _is_ready(self):
        for process in self._processes:
            process.check()
        try:
            status = self.status()
        except OSError:
            return False  # the page is not up yet
        gimbals, vehicle = status["gimbals"], status["vehicle"]
        if not gimbals or gimbals[0]["state"] != "alive" or not gimbals[0]["model"]:
            return False
        if gimbals[0]["attitude"]["pitch_deg"] is None:
            return False
        return vehicle["heading_deg"] is not None and vehicle["position_age_ms"] is not None

    def status(self):
        return json.loads(get(f"{self.http}/api/v1/status")[1])

    def gimbal(self):
        """The only gimbal, as the daemon sees it."""
        return self.status()["gimbals"][0]

    def owners(self):
        """Primary and secondary control on the page, such as "255/190"; None for nobody."""
        gimbal = self.gimbal()
        return gimbal["primary"], gimbal["secondary"]

    def wait_owners(self, primary, secondary=None):
        wait_for(
            lambda: f"control by {primary} and {secondary} on the page; it says {self.owners()}",
            lambda: self.owners() == (primary, secondary),
            2,
        )

    def refusals(self, ids):
        """How many setpoints and commands of `ids` the page counts as refused."""
        return sum(self.gimbal()["rejected"].get("{}/{}".format(*ids), {}).values())
