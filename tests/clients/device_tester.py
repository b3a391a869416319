"""The steps of MAVSDK's `gimbal_device_tester`, against `gimbald sim gimbal` itself and nothing between.

The tester plays an autopilot: under the gimbal's system id it sends AUTOPILOT_STATE_FOR_GIMBAL_DEVICE and
GIMBAL_DEVICE_SET_ATTITUDE twenty times a second to everybody, without frame flags, and looks at what the gimbal reports.
It allows 5° everywhere, and 5 s for an angle; here a step is over as soon as the gimbal stays there.

Each block of its steps begins with the camera ahead, so that several gimbals can go through them side by side.
"""

import concurrent.futures
import math
import threading
import time

import pymavlink

from attitudes import angles_of
from dialect import mavlink, mavutil
from ground import FOLLOW, LOCK, NAN, YAW_IN_EARTH_FRAME, YAW_IN_VEHICLE_FRAME, quaternion
from rig import GIMBALD, LOGS, Process
from stalls import stalled
from steps import Steps, angle_between, expect, wait_for

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
INFORMATION = mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_INFORMATION
STATUS = mavlink.MAVLINK_MSG_ID_GIMBAL_DEVICE_ATTITUDE_STATUS

TOLERANCE = 5.0
# The longest that an angle may take; how many reports in a row have to be there, and how near to each other.
PATIENCE = 5.0
STEADY = 3
STILL = 0.5
# The quaternion is not looked at beyond, for fear of its singularity.
STEEP = 80.0
# What the tester takes where the gimbal says that there is no limit.
NO_LIMIT = 60.0


class Tester:
    """`with Tester("name", system_id, component_id) as tester:` gives a gimbal that is alone with its tester."""

    def __init__(self, name, system_id, component_id, *options):
        self._name = name
        self._source = (system_id, component_id)
        self._options = ("--system-id", str(system_id), "--component-id", str(component_id), *options)
        self._lock = threading.Condition()
        self._heard = []
        self._setpoint = None
        self._heading = 0.0
        self._turning = 0.0
        self._error = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self):
        LOGS.mkdir(parents=True, exist_ok=True)
        self._link = mavutil.mavlink_connection(
            "udpin:127.0.0.1:0",
            source_system=self._source[0],
            source_component=mavlink.MAV_COMP_ID_AUTOPILOT1,
            robust_parsing=False,
        )
        port = self._link.port.getsockname()[1]
        arguments = [GIMBALD, "sim", "gimbal", "--endpoint", f"udpout:127.0.0.1:{port}", *self._options]
        self._gimbal = Process("gimbald sim gimbal", arguments, LOGS / f"device-tester-{self._name}.log")
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join(5)
        self._gimbal.kill()
        self._link.close()

    def _run(self):
        beat_at = setpoint_at = told_at = time.monotonic()
        try:
            while not self._stop.is_set():
                now = time.monotonic()
                with self._lock:
                    self._heading += self._turning * (now - told_at)
                    told_at = now
                if now >= beat_at:
                    beat_at = now + 1.0
                    self._send("heartbeat", mavlink.MAV_TYPE_GENERIC, mavlink.MAV_AUTOPILOT_GENERIC, 0, 0, 4)
                if self._setpoint and now >= setpoint_at:
                    # In steps of 50 ms from the first one on, whatever each of them took.
                    setpoint_at = max(setpoint_at + 0.05, now)
                    self._tell()
                message = self._link.recv_match(blocking=True, timeout=0.005)
                if message is not None:
                    with self._lock:
                        self._heard.append((time.monotonic(), message))
        except mavlink.MAVError as error:
            self._error = f"undecodable: {error}"

    def _send(self, name, *fields):
        """Nobody hears it before the gimbal has spoken."""
        if self._link.clients:
            with self._lock:
                getattr(self._link.mav, f"{name}_send")(*fields)

    def _tell(self):
        with self._lock:
            flags, q, rates = self._setpoint
            heading = quaternion(0, self._heading)
        known = mavlink.ESTIMATOR_ATTITUDE | mavlink.ESTIMATOR_VELOCITY_HORIZ | mavlink.ESTIMATOR_VELOCITY_VERT
        landed = mavlink.MAV_LANDED_STATE_IN_AIR
        self._send("autopilot_state_for_gimbal_device", 0, 0, 0, heading, 0, 0, 0, 0, 0, 0, known, landed, NAN)
        self._send("gimbal_device_set_attitude", 0, 0, flags, q, *map(math.radians, rates))

    def check(self):
        self._gimbal.check()
        expect(self._error is None, self._error)

    def heard(self, name, since=0.0):
        """(time, message) of each of that name."""
        with self._lock:
            everything = list(self._heard)
        return [(at, message) for at, message in everything if at >= since and message.get_type() == name]

    def first(self, name, since, timeout):
        def arrived():
            self.check()
            return self.heard(name, since)

        return wait_for(f"{name}", arrived, timeout)[0][1]

    def attitudes(self, since=0.0):
        """Pitch and yaw of what was reported, as counted from North whatever the flags say."""
        return [angles_of(message.q)[1:] for _, message in self.heard("GIMBAL_DEVICE_ATTITUDE_STATUS", since)]

    def last_attitude(self):
        """When it came, and pitch and yaw."""
        at, message = self.heard("GIMBAL_DEVICE_ATTITUDE_STATUS")[-1]
        return at, *angles_of(message.q)[1:]

    def steer(self, flags, q=(NAN,) * 4, rates=(NAN,) * 3):
        """Rates about roll, pitch and yaw in degrees per second."""
        with self._lock:
            self._setpoint = (flags, list(q), rates)

    def turn_to(self, heading):
        """The vehicle is turned there at once."""
        with self._lock:
            self._heading = heading

    def turning(self, rate):
        """From now on the vehicle turns, degrees per second."""
        with self._lock:
            self._turning = rate

    def command(self, command, *parameters, target, timeout=2.0):
        """Sends a COMMAND_LONG, once, and gives the result that it is answered with."""
        since = time.monotonic()
        self._send("command_long", *target, command, 0, *parameters, *[0] * (7 - len(parameters)))
        ack = self.first("COMMAND_ACK", since, timeout)
        expect(ack.command == command, f"an answer to {ack.command}")
        receiver = (ack.target_system, ack.target_component)
        expect(receiver == (self._source[0], mavlink.MAV_COMP_ID_AUTOPILOT1), f"the answer is for {receiver}")
        return ack.result

    # --- what the tester looks at ---

    def answers(self):
        """Discovery, and every way of addressing a request."""
        system, component = self._source
        self.first("HEARTBEAT", 0.0, 5.0)
        # MAVSDK addresses a system without an autopilot in it as component 0.
        for target in ((system, 0), (system, component), (0, 0)):
            since = time.monotonic()
            result = self.command(mavlink.MAV_CMD_REQUEST_MESSAGE, INFORMATION, target=target)
            expect(result == ACCEPTED, f"a request to {target} is answered with {result}")
            self.information = self.first("GIMBAL_DEVICE_INFORMATION", since, 2.0)
            result = self.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, STATUS, 0, target=target)
            expect(result == ACCEPTED, f"an interval from {target} is answered with {result}")
        expect(self.information.gimbal_device_id == 0, "the device is no component of its own")

    def converges(self):
        """The camera looks ahead within 20 s, and the gimbal says what it is as soon as it is steered."""
        since = time.monotonic()
        self.steer(FOLLOW, quaternion(0, 0))

        def ahead():
            self.check()
            return [yaw for _, yaw in self.attitudes(since)[-1:] if abs(yaw) < 1.0]

        wait_for("a yaw of 0° ± 1°", ahead, 20)
        status = self.first("GIMBAL_DEVICE_ATTITUDE_STATUS", since, 1)
        source = (status.get_srcSystem(), status.get_srcComponent())
        expect(source == self._source, f"the source is {source}")
        expect((status.target_system, status.target_component) == (0, 0), f"for one alone: {status}")
        # The tester looks for it once the yaw is there, which may be with the first report after the first setpoint.
        # One that was on its way then may come before.
        reports = wait_for("three reports", lambda: self.heard("GIMBAL_DEVICE_ATTITUDE_STATUS", since)[2:], 5)
        beats = [beat for at, beat in self.heard("HEARTBEAT", since) if at < reports[0][0]]
        expect(beats, "no HEARTBEAT before the third report")
        expect(beats[0].type == mavlink.MAV_TYPE_GIMBAL, f"type {beats[0].type}")

    def limits(self):
        told = self.information
        pitch_min, pitch_max = math.degrees(told.pitch_min), math.degrees(told.pitch_max)
        if math.isinf(told.yaw_min):
            return pitch_min, pitch_max, None, None
        return pitch_min, pitch_max, math.degrees(told.yaw_min), math.degrees(told.yaw_max)

    def angle(self, flags, pitch, yaw):
        """The camera gets there and stays."""
        wanted = yaw if flags & mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK else yaw + self._heading
        since = time.monotonic()
        self.steer(flags, quaternion(pitch, yaw))
        seen = []

        def arrived():
            self.check()
            seen[:] = self.attitudes(since)[-STEADY:]
            if len(seen) < STEADY or max(one[0] for one in seen) - min(one[0] for one in seen) > STILL:
                return False
            if abs(pitch) > STEEP:
                return True
            still = all(angle_between(one[1], seen[0][1]) < STILL for one in seen)
            there = abs(seen[-1][0] - pitch) <= TOLERANCE and angle_between(seen[-1][1], wanted) <= TOLERANCE
            return still and there

        wait_for(lambda: f"pitch {pitch:.0f}° and yaw {wanted:.0f}°; last seen {seen}", arrived, PATIENCE)

    def angles(self, flags, *wanted):
        for pitch, yaw in wanted:
            self.angle(flags, pitch, yaw)

    def tilt(self):
        pitch_min, pitch_max, _, _ = self.limits()
        self.angles(FOLLOW, (0, 0), (-45, 0), (pitch_min, 0), (pitch_max, 0), (0, 0))

    def pan(self, flags, margin):
        _, _, yaw_min, yaw_max = self.limits()
        left, right = (-NO_LIMIT, NO_LIMIT) if yaw_min is None else (yaw_min + margin, yaw_max - margin)
        self.angles(flags, (0, right), (0, left), (-45, 0), (-45, right), (-45, left), (0, 0))

    def follow(self):
        self.angle(FOLLOW, 0, 0)
        self.pan(FOLLOW, 0)

    def lock(self):
        self.angle(LOCK, 0, 0)
        self.turn_to(-30)
        self.pan(LOCK, 30)
        self.angle(FOLLOW, 0, 0)

    def rate(self, pitch, yaw, seconds):
        _, *before = self.last_attitude()
        started = time.monotonic()
        self.steer(FOLLOW, rates=(0, pitch, yaw))
        time.sleep(seconds)
        self.check()
        seen, *after = self.last_attitude()
        lasted = seen - started
        for axis, rate, was, at in zip(("pitch", "yaw"), (pitch, yaw), before, after):
            wanted = was + rate * lasted
            reason = f"{axis} is {at:.1f}° instead of {wanted:.1f}° after {lasted:.2f} s"
            expect(angle_between(at, wanted) <= TOLERANCE, reason)

    def stop(self):
        self.steer(FOLLOW, rates=(0, 0, 0))
        time.sleep(0.5)

    def pitch_rates(self):
        self.angle(FOLLOW, 0, 0)
        self.rate(-10, 0, 5)
        self.stop()
        self.rate(20, 0, 2.5)
        self.angle(FOLLOW, 0, 0)

    def yaw_rates(self):
        self.angle(FOLLOW, 0, 0)
        self.rate(0, 5, 5)
        self.stop()
        self.rate(0, -10, 5)
        self.angle(FOLLOW, 0, 0)

    def angle_and_rate(self):
        self.angle(FOLLOW, 0, 0)
        for pitch, rate, seconds in ((-20, -10, 2.0), (0, 5, 4.0)):
            _, before, _ = self.last_attitude()
            started = time.monotonic()
            self.steer(FOLLOW, quaternion(pitch, 0), (0, rate, 0))
            for part in ("half-way", "at the end"):
                time.sleep(seconds / 2)
                self.check()
                seen, at, _ = self.last_attitude()
                wanted = before + rate * min(seen - started, seconds)
                expect(abs(at - wanted) <= TOLERANCE, f"pitch is {at:.1f}° instead of {wanted:.1f}° {part}")
            self.stop()
        self.angle(FOLLOW, 0, 0)

    # --- beyond the tester ---

    def turns_under_a_lock(self):
        """While yaw is locked the vehicle turns under the camera, and the camera does not turn with it."""
        self.angle(LOCK, -10, 20)
        since, heading = time.monotonic(), self._heading
        self.turning(20)
        time.sleep(3)
        self.turning(0)
        time.sleep(0.3)
        self.check()
        heard = [(at, angles_of(message.q)[2]) for at, message in self.heard("GIMBAL_DEVICE_ATTITUDE_STATUS", since)]
        off = [(at, yaw) for at, yaw in heard if angle_between(yaw, 20) > TOLERANCE]
        # The camera goes by the heading that it was told, which in a stall is that of before.
        off = [yaw for at, yaw in off if not stalled(at - 0.3, at)]
        expect(not off, f"the camera turned with the vehicle: {off}")
        turned = self._heading - heading
        expect(turned > 50, f"the vehicle turned only {turned:.0f}°")

    def honest(self, frame):
        """Flags, quaternion and delta_yaw say one thing, in the frame that was asked for."""
        self.turn_to(70)
        heading = 70
        for flags, yaw, by_lock in ((FOLLOW, 10, YAW_IN_VEHICLE_FRAME), (LOCK, 40, YAW_IN_EARTH_FRAME)):
            since = time.monotonic()
            self.steer(flags, quaternion(-10, yaw))
            wanted = yaw if flags == LOCK else yaw + heading

            def arrived():
                self.check()
                told = [message for _, message in self.heard("GIMBAL_DEVICE_ATTITUDE_STATUS", since)][-STEADY:]
                return len(told) == STEADY and all(is_there(message, wanted) for message in told) and told[-1]

            def is_there(message, wanted):
                offset = 0 if message.flags & YAW_IN_EARTH_FRAME else math.degrees(message.delta_yaw)
                return angle_between(angles_of(message.q)[1:][1] + offset, wanted) < 1.0

            status = wait_for(f"yaw {wanted}° from North", arrived, PATIENCE)
            said = status.flags & (YAW_IN_VEHICLE_FRAME | YAW_IN_EARTH_FRAME)
            expect(said == (YAW_IN_EARTH_FRAME if frame == "earth" else by_lock), f"frame flags {said}: {status}")
            locked = bool(status.flags & mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK)
            expect(locked == (flags == LOCK), f"lock: {status}")
            delta = math.degrees(status.delta_yaw)
            expect(angle_between(delta, heading) < 1, f"delta_yaw {delta:.1f}°")

    def unknown_heading(self):
        """Before an autopilot told where North is, the gimbal does not pretend to know."""
        status = self.first("GIMBAL_DEVICE_ATTITUDE_STATUS", 0.0, 2)
        said = status.flags & (YAW_IN_VEHICLE_FRAME | YAW_IN_EARTH_FRAME)
        expect(said == YAW_IN_VEHICLE_FRAME and math.isnan(status.delta_yaw), str(status))

    def rhythm(self):
        """285 comes four times a second before the first setpoint."""
        def reports():
            told = self.heard("GIMBAL_DEVICE_ATTITUDE_STATUS")
            return len(told) >= 8 and told

        times = [message.time_boot_ms for _, message in wait_for("eight reports", reports, 5)]
        gaps = sorted(after - before for before, after in zip(times, times[1:]))
        expect(240 <= gaps[len(gaps) // 2] <= 260, f"after {gaps} ms")


def fast(name, system_id, component_id, *options):
    return Tester(name, system_id, component_id, "--slew", "200", *options)


def angles(steps):
    with fast("angles", 33, mavlink.MAV_COMP_ID_GIMBAL) as tester:
        steps.run("answers requests to its component, to its system and to everybody", tester.answers, essential=True)
        steps.run("reports four times a second while nobody steers it", tester.rhythm)
        steps.run("does not claim to know North before it was told", tester.unknown_heading)
        steps.run("looks ahead, and says that it is a gimbal", tester.converges, essential=True)
        steps.run("pitch angles", tester.tilt)
        steps.run("yaw angles in follow mode", tester.follow)


def lock(steps):
    with fast("lock", 33, mavlink.MAV_COMP_ID_GIMBAL4) as tester:
        steps.run("lock: answers", tester.answers, essential=True)
        steps.run("lock: looks ahead", tester.converges, essential=True)
        steps.run("yaw angles in lock mode, the vehicle turned", tester.lock)
        steps.run("a lock holds while the vehicle turns", tester.turns_under_a_lock)


def ends(steps, mode, component_id):
    with fast(f"ends-{mode}", 7, component_id, "--yaw-range", "160") as tester:
        steps.run(f"end stops, {mode}: answers", tester.answers, essential=True)
        steps.run(f"end stops, {mode}: looks ahead", tester.converges, essential=True)
        steps.run(f"end stops, {mode}: yaw angles", getattr(tester, mode))


def ends_in_follow(steps):
    ends(steps, "follow", mavlink.MAV_COMP_ID_GIMBAL2)


def ends_in_lock(steps):
    ends(steps, "lock", mavlink.MAV_COMP_ID_GIMBAL2)


def pitch(steps):
    with fast("pitch", 250, mavlink.MAV_COMP_ID_GIMBAL3) as tester:
        steps.run("pitch: answers", tester.answers, essential=True)
        steps.run("pitch: looks ahead", tester.converges, essential=True)
        tester.turn_to(-30)
        steps.run("pitch rates", tester.pitch_rates)
        steps.run("pitch angle with its rate, half-way and at the end", tester.angle_and_rate)


def yaw(steps):
    with fast("yaw", 33, mavlink.MAV_COMP_ID_GIMBAL6) as tester:
        steps.run("yaw: answers", tester.answers, essential=True)
        steps.run("yaw: looks ahead", tester.converges, essential=True)
        tester.turn_to(-30)
        steps.run("yaw rates", tester.yaw_rates)
        steps.run("reports yaw from North", lambda: tester.honest("earth"))


def by_lock(steps):
    with fast("by-lock", 33, mavlink.MAV_COMP_ID_GIMBAL5, "--status-frame", "lock") as tester:
        steps.run("frame by lock: answers", tester.answers, essential=True)
        steps.run("frame by lock: looks ahead", tester.converges, essential=True)
        steps.run("reports yaw from North while it is locked, else from the nose", lambda: tester.honest("lock"))


def main():
    steps = Steps(f"device tester with pymavlink {pymavlink.__version__}")

    def body():
        blocks = (angles, ends_in_follow, ends_in_lock, lock, pitch, yaw, by_lock)
        with concurrent.futures.ThreadPoolExecutor(len(blocks)) as pool:
            runs = [pool.submit(block, steps) for block in blocks]
            for run in concurrent.futures.as_completed(runs):
                run.result()

    steps.script(body)


main()
