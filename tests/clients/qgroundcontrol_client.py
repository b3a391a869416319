"""QGroundControl as a gimbal manager knows it: what it sends, when, and what it makes of the answers.

It differs much from one release to the next; `GENERATIONS` says how. It plays what the operator sees: whether there is
a gimbal control at all, who has control, where the camera looks, and whether a click was thrown away.
"""

import math
import threading
import time
from collections import Counter, deque
from typing import NamedTuple

from attitudes import angles_of, wrapped
from dialect import mavlink, mavutil
from steps import expect

NAN = math.nan

AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
ACCEPTED, IN_PROGRESS = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS
REQUEST_MESSAGE, SET_MESSAGE_INTERVAL = mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
PITCHYAW, CONFIGURE = mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW, mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE
ROI_LOCATION, ROI_NONE = mavlink.MAV_CMD_DO_SET_ROI_LOCATION, mavlink.MAV_CMD_DO_SET_ROI_NONE
INFORMATION, STATUS, ATTITUDE = 280, 281, 285

RETRACT, NEUTRAL, FOLLOW, YAW_LOCK = 1, 2, 12, 16
LOCK = FOLLOW | YAW_LOCK
IN_VEHICLE_FRAME, IN_EARTH_FRAME = 32, 64

# Seconds.
ACK_WAIT = 3.0
ACK_CHECK = 0.5
MESSAGE_WAIT = 1.0
RATE_REPEAT = 0.5
DRAG_REPEAT = 0.1

# Its settings as they come: degrees, degrees per second.
FIELD_OF_VIEW = 80
BUTTON_RATE = 20
SLIDE_SPEED = 30


class Generation(NamedTuple):
    name: str
    # Whether all of the start-up has to be over before it looks at gimbals, or the parameters only.
    waits_for_all: bool = False
    # How often one component is asked for GIMBAL_MANAGER_INFORMATION.
    requests: int = 6
    # Whether the next one is asked for a message only when the last one has sent it.
    one_request_at_a_time: bool = False
    # Whether commands go to the autopilot's component.
    to_autopilot: bool = False
    # What stands for no rate beside an angle.
    no_rate: float = NAN
    # Flags of an angle from the nose.
    body_flags: int = FOLLOW | IN_VEHICLE_FRAME
    # Whether its buttons turn the gimbal by messages, and whether its other parts can.
    rates_as_messages: bool = False
    has_gimbal_rate: bool = False
    # Whether it believes the gimbal's `delta_yaw`.
    knows_delta_yaw: bool = False
    # x and y of the command that ends a ROI.
    unset_coordinate: int = 0


FIRST_4_4 = Generation("4.4.0", requests=3, to_autopilot=True, no_rate=0.0, body_flags=FOLLOW)
LINE_2024 = Generation("4.4.x and 5.0")
EARLY_2026 = Generation("early 2026", has_gimbal_rate=True, unset_coordinate=-(2**31))
NEWEST = Generation(
    "newest",
    waits_for_all=True,
    one_request_at_a_time=True,
    rates_as_messages=True,
    has_gimbal_rate=True,
    knows_delta_yaw=True,
    unset_coordinate=2**31 - 1,
)


class Gimbal:
    """One that it has heard of, as (manager's component, device id)."""

    def __init__(self, key):
        self.key = key
        self.information = None
        self.has_status = self.has_attitude = self.is_complete = False
        self.information_tries, self.status_tries, self.attitude_tries = 3, 6, 3
        self.status_asked_at = 0.0
        self.have_control = self.others_have_control = False
        self.flags = 0
        self.pitch = self.body_yaw = self.absolute_yaw = 0.0

    @property
    def manager(self):
        return self.key[0]

    @property
    def device(self):
        return self.key[1]

    @property
    def yaw_lock(self):
        return bool(self.flags & YAW_LOCK)

    @property
    def label(self):
        if self.flags & RETRACT:
            return "Retracted"
        return "Yaw locked" if self.yaw_lock else "Yaw follow"


class Waiting:
    """A command on its way."""

    def __init__(self, send, tries, shows_error):
        self.send, self.tries, self.shows_error = send, tries, shows_error
        self.confirmation = 0
        self.sent_at = time.monotonic()


class ThrownAway(NamedTuple):
    """A command that was not sent, because at `until` the one of `since` had no answer yet."""

    key: tuple
    since: float
    until: float


class QGroundControl:
    """`with QGroundControl(port, generation) as client:`; its calls are what the operator does."""

    ids = (255, mavlink.MAV_COMP_ID_MISSIONPLANNER)

    def __init__(self, port, generation, vehicle=1):
        self.generation = generation
        self._vehicle = vehicle
        self._link = mavutil.mavlink_connection(
            f"udpout:127.0.0.1:{port}", source_system=self.ids[0], source_component=self.ids[1], robust_parsing=False
        )
        self._lock = threading.RLock()
        self._waiting = {}
        self._tries = Counter()
        self._informed = set()
        self._gimbals = {}
        self._phase = None
        self._parameters = set()
        self._autopilot = None
        self._capabilities = 0
        self._heading = 0.0
        self._requests = deque()
        self._request = None
        self._rates = (0.0, 0.0)
        self._rate_at = self._drag_at = None
        self._drag = (0.0, 0.0)
        # What the operator sees, and what went wrong.
        self.listed = []
        self.active = None
        self.gate_at = self.found_at = None
        self.popups = 0
        self.errors = []
        self.thrown_away = []
        self.unanswered = []
        self.answer_times = []
        self.strange = []
        self._error = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join(5)
        self._link.close()

    def check(self):
        expect(self._error is None, self._error)
        expect(not self.strange, f"{self.strange[:1]}")

    # --- the loop ----------------------------------------------------------------------------------------------

    def _run(self):
        beat_at = check_at = 0.0
        try:
            while not self._stop.is_set():
                now = time.monotonic()
                with self._lock:
                    if now >= beat_at:
                        beat_at = now + 1.0
                        self._send("heartbeat", mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4)
                    if now >= check_at:
                        check_at = now + ACK_CHECK
                        self._give_up(now)
                    self._turn_and_drag(now)
                try:
                    message = self._link.recv_match(blocking=True, timeout=0.01)
                except ConnectionRefusedError:
                    continue
                # What comes from another system is not looked at.
                if message is not None and message.get_srcSystem() in (self._vehicle, 0):
                    with self._lock:
                        self._hear(message.get_type(), message, message.get_srcComponent())
        except Exception as error:  # whatever it is, a step has to tell
            self._error = f"{type(error).__name__}: {error}"

    def _send(self, name, *fields):
        getattr(self._link.mav, f"{name}_send")(*fields)

    def _hear(self, name, message, component):
        if name == "HEARTBEAT" and component == AUTOPILOT and self._phase is None:
            self._autopilot = message.autopilot
            self._enter(0)
        if self._phase is None:
            return
        if name == "ATTITUDE" and component == AUTOPILOT:
            # It shows whole degrees.
            self._heading = math.trunc(math.degrees(message.yaw) % 360)
        elif name == "COMMAND_ACK":
            self._handle_ack(message, component)
        self._start_up(name, message, component)
        if self.gate_at is None:
            return
        if name == "HEARTBEAT":
            self._handle_heartbeat(component)
        elif name == "GIMBAL_MANAGER_INFORMATION":
            self._handle_information(message, component)
        elif name == "GIMBAL_MANAGER_STATUS":
            self._handle_status(message, component)
        elif name == "GIMBAL_DEVICE_ATTITUDE_STATUS":
            self._handle_attitude(message, component)

    # --- start-up ----------------------------------------------------------------------------------------------

    # AUTOPILOT_VERSION, AVAILABLE_MODES, COMPONENT_METADATA; then parameters, mission, fence and rally points.
    PHASES = [("ask", 148), ("ask", 435), ("ask", 397), ("parameters",), ("mission", 0), ("mission", 1), ("mission", 2)]

    def _enter(self, phase):
        self._phase = phase
        parameters_known = phase > self.PHASES.index(("parameters",))
        if phase == len(self.PHASES) or (parameters_known and not self.generation.waits_for_all):
            self.gate_at = self.gate_at or time.monotonic()
        if phase == len(self.PHASES):
            return
        kind, *argument = self.PHASES[phase]
        if kind == "ask":
            self._command(AUTOPILOT, REQUEST_MESSAGE, [argument[0]], tries=3)
        elif kind == "parameters":
            self._send("param_request_list", self._vehicle, 0)
        else:
            self._send("mission_request_list", self._vehicle, AUTOPILOT, argument[0])

    def _start_up(self, name, message, component):
        if self._phase == len(self.PHASES) or component != AUTOPILOT:
            return
        kind, *argument = self.PHASES[self._phase]
        if name == "AUTOPILOT_VERSION":
            self._capabilities = message.capabilities
        if kind == "ask":
            # By now it was either sent or refused.
            done = name == "COMMAND_ACK" and message.command == REQUEST_MESSAGE
        elif kind == "parameters":
            if name == "PARAM_VALUE":
                self._parameters.add(message.param_index)
            done = name == "PARAM_VALUE" and self._parameters.issuperset(range(message.param_count))
        else:
            done = name == "MISSION_COUNT" and message.mission_type == argument[0]
            if done:
                self._send("mission_ack", self._vehicle, AUTOPILOT, mavlink.MAV_MISSION_ACCEPTED, argument[0])
        if done:
            self._enter(self._phase + 1)

    # --- commands ----------------------------------------------------------------------------------------------

    def _command(self, component, command, parameters, tries=1, shows_error=False, as_int=None):
        """Each once, and never two of the same to one component at a time. `as_int` are frame, x and y."""
        key = (component, command)
        # The interval of one message says nothing of that of another.
        if command == SET_MESSAGE_INTERVAL:
            key += (parameters[0],)
        if key in self._waiting:
            self.thrown_away.append(ThrownAway(key, self._waiting[key].sent_at, time.monotonic()))
            return
        parameters = list(parameters) + [0.0] * (7 - len(parameters))

        def send(confirmation):
            if as_int is None:
                self._send("command_long", self._vehicle, component, command, confirmation, *parameters)
            else:
                frame, x, y = as_int
                first, z = parameters[:4], parameters[6]
                self._send("command_int", self._vehicle, component, frame, command, 0, 0, *first, x, y, z)

        self._waiting[key] = Waiting(send, tries, shows_error)
        send(0)

    def _handle_ack(self, message, component):
        keys = [key for key in self._waiting if key[:2] == (component, message.command)]
        if not keys:
            return
        waiting = self._waiting[keys[0]]
        if message.result == IN_PROGRESS:
            waiting.sent_at = time.monotonic()
            return
        del self._waiting[keys[0]]
        if component != AUTOPILOT:
            self.answer_times.append(time.monotonic() - waiting.sent_at)
        if message.result != ACCEPTED and waiting.shows_error:
            self.errors.append((message.command, message.result))
        if self._request and message.command == REQUEST_MESSAGE and component == self._request[0]:
            arrived = component in self._informed
            self._request = (component, time.monotonic()) if message.result == ACCEPTED and not arrived else None
            self._next_request()

    def _give_up(self, now):
        for key, waiting in list(self._waiting.items()):
            if now - waiting.sent_at < ACK_WAIT:
                continue
            waiting.tries -= 1
            if waiting.tries:
                waiting.confirmation += 1
                waiting.sent_at = now
                waiting.send(waiting.confirmation)
                continue
            del self._waiting[key]
            self.unanswered.append(key)
            if waiting.shows_error:
                self.errors.append((key[1], None))
            if self._request and key[:2] == (self._request[0], REQUEST_MESSAGE):
                self._request = None
        if self._request and self._request[1] and now - self._request[1] > MESSAGE_WAIT:
            self._request = None
        self._next_request()

    # --- discovery ---------------------------------------------------------------------------------------------

    def _handle_heartbeat(self, component):
        if component not in self._informed and self._tries[component] < self.generation.requests:
            self._tries[component] += 1
            self._ask(component)

    def _ask(self, component):
        if self.generation.one_request_at_a_time:
            self._requests.append(component)
            self._next_request()
        else:
            self._command(component, REQUEST_MESSAGE, [INFORMATION], tries=3)

    def _next_request(self):
        if self._request is None and self._requests:
            # The component, and when it promised the message.
            self._request = (self._requests.popleft(), None)
            self._command(self._request[0], REQUEST_MESSAGE, [INFORMATION], tries=3)

    def asked(self, component):
        """How often a component was asked what it manages."""
        with self._lock:
            return self._tries[component]

    def _known(self, key):
        return self._gimbals.setdefault(key, Gimbal(key))

    def _handle_information(self, message, component):
        if message.gimbal_device_id == 0:
            self.strange.append("information about device 0")
            return
        gimbal = self._known((component, message.gimbal_device_id))
        gimbal.information = message
        self._informed.add(component)
        if self._request and self._request[0] == component and self._request[1]:
            self._request = None
            self._next_request()
        self._check_complete(gimbal)

    def _handle_status(self, message, component):
        if message.gimbal_device_id == 0:
            self.strange.append("status of device 0")
            return
        gimbal = self._known((component, message.gimbal_device_id))
        gimbal.has_status = True
        primary = (message.primary_control_sysid, message.primary_control_compid)
        gimbal.have_control = primary == self.ids
        gimbal.others_have_control = not gimbal.have_control and 0 not in primary
        self._check_complete(gimbal)

    def _handle_attitude(self, message, component):
        if message.gimbal_device_id == 0:
            keys = [key for key in self._gimbals if key[1] == component]
            if not keys:
                return
            key = keys[0]
        elif message.gimbal_device_id <= 6:
            key = (component, message.gimbal_device_id)
        else:
            self.strange.append(f"attitude of device {message.gimbal_device_id}")
            return
        gimbal = self._known(key)
        gimbal.has_attitude = True
        gimbal.flags = message.flags
        _, gimbal.pitch, yaw = angles_of(message.q)
        frames = message.flags & (IN_VEHICLE_FRAME | IN_EARTH_FRAME)
        heading = self._heading
        if self.generation.knows_delta_yaw and frames and not math.isnan(message.delta_yaw):
            heading = math.degrees(message.delta_yaw)
        if frames == IN_VEHICLE_FRAME or (frames == 0 and not gimbal.yaw_lock):
            gimbal.body_yaw, gimbal.absolute_yaw = yaw, wrapped(yaw + heading)
        else:
            gimbal.body_yaw, gimbal.absolute_yaw = wrapped(yaw - heading), yaw
        self._check_complete(gimbal)

    def _check_complete(self, gimbal):
        if gimbal.is_complete:
            return
        now = time.monotonic()
        if gimbal.information is None and gimbal.information_tries:
            gimbal.information_tries -= 1
            self._ask(gimbal.manager)
        if not gimbal.has_status and gimbal.status_tries and now - gimbal.status_asked_at > 1.0:
            # The default rate; at last one in five seconds.
            interval = 0 if gimbal.status_tries > 2 else 5_000_000
            gimbal.status_tries -= 1
            gimbal.status_asked_at = now
            self._command(gimbal.manager, SET_MESSAGE_INTERVAL, [STATUS, interval])
        if not gimbal.has_attitude and gimbal.attitude_tries and gimbal.information:
            gimbal.attitude_tries -= 1
            component = gimbal.device if gimbal.device > 6 else gimbal.manager
            self._command(component, SET_MESSAGE_INTERVAL, [ATTITUDE, 0])
        if gimbal.information and gimbal.has_status and gimbal.has_attitude:
            gimbal.is_complete = True
            self.listed.append(gimbal.key)
            if self.active is None:
                self.active = gimbal
                self.found_at = now

    def is_waiting(self):
        """Whether a command has no answer yet; another of its kind would be thrown away."""
        with self._lock:
            return bool(self._waiting)

    # --- what the operator does --------------------------------------------------------------------------------

    def acquire(self):
        with self._lock:
            self._configure(*self.ids)

    def release(self):
        with self._lock:
            self._configure(-3, -3)

    def _configure(self, system, component):
        parameters = [system, component, -1, -1, NAN, NAN, self.active.device]
        self._command(self._commanded, CONFIGURE, parameters, shows_error=True)

    @property
    def _commanded(self):
        return AUTOPILOT if self.generation.to_autopilot else self.active.manager

    def _has_control(self):
        """Whether to go on with an action; asks for control where nobody has it, and asks the operator where another has."""
        if self.active.others_have_control:
            self.popups += 1
            return False
        if not self.active.have_control:
            self.acquire()
        return True

    def _pitchyaw(self, pitch, yaw, pitch_rate, yaw_rate, flags, shows_error=False):
        parameters = [pitch, yaw, pitch_rate, yaw_rate, flags, 0, self.active.device]
        self._command(self._commanded, PITCHYAW, parameters, shows_error=shows_error)

    def _angles(self, pitch, yaw, flags, shows_error=False):
        if self._has_control():
            self._rate_at = None
            no_rate = self.generation.no_rate
            self._pitchyaw(pitch, yaw, no_rate, no_rate, flags, shows_error)

    def center(self):
        with self._lock:
            self._angles(0, 0, self.generation.body_flags, shows_error=True)

    def tilt_90(self):
        with self._lock:
            self._angles(-90, 0, self.generation.body_flags, shows_error=True)

    def click(self, pan, tilt):
        """At so much of the picture from its middle, -1 to 1. Gives pitch and yaw that it asks for."""
        with self._lock:
            return self._point(pan * FIELD_OF_VIEW / 2, tilt * FIELD_OF_VIEW / 2)

    def _point(self, right, up):
        gimbal = self.active
        pitch, yaw = gimbal.pitch + up, gimbal.body_yaw + right
        if gimbal.yaw_lock:
            yaw = wrapped(yaw + self._heading)
            self._angles(pitch, yaw, LOCK | IN_EARTH_FRAME)
        else:
            self._angles(pitch, yaw, self.generation.body_flags)
        return pitch, yaw

    def start_drag(self, pan, tilt):
        """The mouse is held down at so much of the picture from its middle."""
        with self._lock:
            self._drag, self._drag_at = (pan, tilt), time.monotonic()

    def stop_drag(self):
        with self._lock:
            self._drag_at = None

    def set_yaw_lock(self, lock):
        with self._lock:
            if not self._has_control():
                return
            gimbal = self.active
            if self.generation.to_autopilot:
                self._pitchyaw(NAN, NAN, NAN, NAN, YAW_LOCK if lock else 0, shows_error=True)
            elif lock:
                self._pitchyaw(gimbal.pitch, gimbal.absolute_yaw, NAN, NAN, LOCK, shows_error=True)
            else:
                self._pitchyaw(gimbal.pitch, gimbal.body_yaw, NAN, NAN, FOLLOW, shows_error=True)

    def retract(self):
        with self._lock:
            if self._has_control():
                gimbal, no_rate = self.active, self.generation.no_rate
                self._pitchyaw(gimbal.pitch, gimbal.body_yaw, no_rate, no_rate, RETRACT, shows_error=True)

    def neutral(self):
        """A button of the first 4.4.0 only."""
        with self._lock:
            if self._has_control():
                self._pitchyaw(0, 0, 0, 0, NEUTRAL, shows_error=True)

    def press(self, pitch=0, yaw=0):
        """A button or a stick is held: -1, 0 or 1."""
        with self._lock:
            self._rates = (pitch * BUTTON_RATE, yaw * BUTTON_RATE)
            self._send_rate()

    def let_go(self):
        self.press(0, 0)

    def forget_rate(self):
        """The rate is not repeated any more, and no zero is sent: the link is gone, or so it seems."""
        with self._lock:
            self._rates, self._rate_at = (0.0, 0.0), None

    def looking_away(self):
        """A `with` in which nothing of what is received is looked at."""
        return self._lock

    def gimbal_rate(self, pitch, yaw):
        """Another part of the program turns the gimbal, and has to ask again within half a second."""
        with self._lock:
            if self._has_control():
                self._rate_message(pitch, yaw)
                self._rate_at = time.monotonic() + RATE_REPEAT if (pitch, yaw) != (0, 0) else None

    def _send_rate(self):
        if not self._has_control():
            return
        if self.generation.rates_as_messages:
            self._rate_message(*self._rates)
        else:
            self._pitchyaw(NAN, NAN, *self._rates, LOCK if self.active.yaw_lock else FOLLOW)
        self._rate_at = time.monotonic() + RATE_REPEAT if self._rates != (0, 0) else None

    def _rate_message(self, pitch, yaw):
        flags = (LOCK if self.active.yaw_lock else FOLLOW) | IN_VEHICLE_FRAME
        rates = (NAN, math.radians(pitch), math.radians(yaw))
        manager, device = self.active.key
        self._send("gimbal_manager_set_attitude", self._vehicle, manager, flags, device, [NAN] * 4, *rates)

    def _turn_and_drag(self, now):
        if self._rate_at and now >= self._rate_at:
            self._send_rate()
        if self._drag_at and now >= self._drag_at:
            self._drag_at += DRAG_REPEAT
            pan, tilt = self._drag
            self._point(pan * SLIDE_SPEED * 0.1, tilt * SLIDE_SPEED * 0.1)

    def roi(self, latitude, longitude, terrain_altitude, with_long=False):
        """A click on the map; it is the autopilot's to look there."""
        with self._lock:
            ardupilot = self._autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
            altitude = 0 if ardupilot else terrain_altitude
            if self._capabilities & mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT and not with_long:
                frames = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT, mavlink.MAV_FRAME_GLOBAL
                place = (frames[not ardupilot], round(latitude * 1e7), round(longitude * 1e7))
                self._command(AUTOPILOT, ROI_LOCATION, [NAN] * 4 + [0, 0, altitude], shows_error=True, as_int=place)
            else:
                parameters = [NAN] * 4 + [latitude, longitude, altitude]
                self._command(AUTOPILOT, ROI_LOCATION, parameters, shows_error=True)

    def cancel_roi(self):
        with self._lock:
            unset = self.generation.unset_coordinate
            place = (mavlink.MAV_FRAME_GLOBAL, unset, unset)
            self._command(AUTOPILOT, ROI_NONE, [NAN] * 7, shows_error=True, as_int=place)


class Qt5QGroundControl(QGroundControl):
    """4.2 and 4.3, who know the older protocol only, and no manager."""

    def __init__(self, port):
        super().__init__(port, Generation("4.2 and 4.3", requests=0))

    def point(self, pitch, yaw):
        with self._lock:
            parameters = [pitch, 0, yaw, 0, 0, 0, mavlink.MAV_MOUNT_MODE_MAVLINK_TARGETING]
            self._command(AUTOPILOT, mavlink.MAV_CMD_DO_MOUNT_CONTROL, parameters)

    def _handle_information(self, message, component):
        pass

    def _handle_status(self, message, component):
        pass

    def _handle_attitude(self, message, component):
        pass
