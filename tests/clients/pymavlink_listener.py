"""Everything that the daemon emits, on every link, decoded by pymavlink without forgiving anything."""

import math
import socket
import threading
import time

import pymavlink

from frames import Frame, decode
from ground import FOLLOW, LOCK, NAN, YAW_IN_EARTH_FRAME, YAW_IN_VEHICLE_FRAME, GroundStation, mavlink, quaternion
from rig import Rig
from steps import Steps, expect, wait_for

SYSTEM_ID = 42
DEVICE = 154
VEHICLE, MANAGER, GIMBAL = (SYSTEM_ID, 1), (SYSTEM_ID, 191), (SYSTEM_ID, DEVICE)
CLIENT = (255, 190)

# Seconds in which nothing but streams goes by.
QUIET = 6


class Listener:
    """A ground station that says nothing."""

    def __init__(self, port):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self._socket.bind(("127.0.0.1", port))
        self._socket.settimeout(0.1)
        self._datagrams = []
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._stop.set()
        self._thread.join(5)
        self._socket.close()

    def _run(self):
        while not self._stop.is_set():
            try:
                self._datagrams.append((time.monotonic(), self._socket.recv(65536)))
            except socket.timeout:
                continue

    def seen(self):
        return list(self._datagrams)


def pairwise(values):
    return zip(values, values[1:])


def expect_sources(frames, allowed):
    sources = {frame.source for frame in frames}
    expect(sources <= allowed, f"frames of {sources - allowed}")


def exercise(client):
    """Has the daemon send all that it can send."""
    for message_id in (280, 281):
        client.command(mavlink.MAV_CMD_REQUEST_MESSAGE, message_id)
    client.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 283, component=DEVICE)
    client.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 11045)
    client.command(mavlink.MAV_CMD_GET_MESSAGE_INTERVAL, 281)
    client.command(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 281, 0)
    client.configure(client.ids)
    client.pitchyaw(-30, 20)
    client.set_pitchyaw(-35, 25, flags=FOLLOW | YAW_IN_VEHICLE_FRAME)
    client.set_pitchyaw(pitch_rate=5, yaw_rate=-5)
    client.set_attitude(quaternion(-10, 60), flags=LOCK | YAW_IN_EARTH_FRAME)
    client.set_attitude(rates=(0, 3, 3))
    client.pitchyaw(NAN, NAN, 5, 5)
    client.pitchyaw(NAN, NAN, NAN, NAN)
    client.command(mavlink.MAV_CMD_DO_SET_ROI_LOCATION, DEVICE, NAN, NAN, NAN, 47.4, 8.55, 500)
    client.command(mavlink.MAV_CMD_DO_SET_ROI_NONE, DEVICE)
    client.pitchyaw(0, 0, flags=FOLLOW | mavlink.GIMBAL_MANAGER_FLAGS_NEUTRAL)
    client.pitchyaw(-20, 90, flags=LOCK)
    client.attitudes.wait_at(pitch=-20, yaw_north=90)
    client.configure((-3, -3), (-3, -3))


def body(steps, rig, listener, client):
    steps.run("a client uses all there is", lambda: exercise(client), essential=True)
    quiet_from = time.monotonic()
    wait_for("a quiet time", lambda: time.monotonic() - quiet_from >= QUIET, QUIET + 1)
    quiet_to = time.monotonic()

    def before(chunks):
        return [chunk for chunk in chunks if chunk[0] <= quiet_to]

    ground, autopilot, serial = [], [], []
    vehicle_sent = []

    def decodes_ground():
        ground.extend(decode(before(listener.seen()), whole=True))
        expect_sources(ground, {VEHICLE, MANAGER, GIMBAL, CLIENT})
        return f"{len(ground)} frames, {len({frame.name for frame in ground})} kinds"

    def decodes_autopilot():
        from_daemon, from_vehicle = rig.wire.seen()
        autopilot.extend(decode(before(from_daemon), whole=True))
        vehicle_sent.extend(decode(before(from_vehicle), whole=True))
        expect_sources(autopilot, {MANAGER, GIMBAL, CLIENT})
        return f"{len(autopilot)} frames"

    def decodes_serial():
        from_daemon, from_gimbal = rig.cable.seen()
        # The line may be in the middle of a frame when the time is over, but never when a frame begins.
        serial.extend(decode(before(from_daemon), whole=False))
        expect_sources(serial, {VEHICLE, MANAGER, CLIENT})
        decode(before(from_gimbal), whole=False)
        return f"{len(serial)} frames"

    steps.run("decodes everything on the ground link", decodes_ground)
    steps.run("decodes everything on the autopilot's link", decodes_autopilot)
    steps.run("decodes everything on the gimbal's line", decodes_serial)
    links = {"ground": ground, "autopilot": autopilot, "gimbal": serial}

    def ours(frames, name=None):
        return [frame for frame in frames if frame.source == MANAGER and name in (None, frame.name)]

    def sequence_numbers():
        gaps = []
        for link, frames in links.items():
            sent = ours(frames)
            expect(sent, f"nothing of the manager on the {link} link")
            for one, following in pairwise(sent):
                before, after = one.message.get_seq(), following.message.get_seq()
                if after != (before + 1) % 256:
                    at = following.time - sent[0].time
                    gaps.append(f"{link} link {at:.2f} s: {following.name} {after} after {one.name} {before}")
        expect(not gaps, f"{len(gaps)} gaps: {'; '.join(gaps[:10])}")

    def in_mavlink_2():
        for link, frames in links.items():
            for frame in ours(frames):
                data = frame.bytes
                expect(data[0] == 0xFD, f"{frame.name} on the {link} link is MAVLink 1")
                expect(data[1] == 1 or data[9 + data[1]] != 0, f"{frame.name} on the {link} link ends in zeros")

    def heartbeat():
        for link, frames in links.items():
            beats = ours(frames, "HEARTBEAT")
            fields = {
                (beat.message.type, beat.message.autopilot, beat.message.base_mode, beat.message.custom_mode)
                for beat in beats
            }
            expect(fields == {(18, 8, 0, 0)}, f"type, autopilot and modes on the {link} link: {fields}")
            quiet = [beat.time for beat in beats if beat.time >= quiet_from]
            gaps = [after - before for before, after in pairwise(quiet)]
            expect(QUIET - 1 <= len(quiet) <= QUIET + 1, f"{len(quiet)} in {QUIET} s on the {link} link: {gaps}")
        states = {beat.message.system_status for beat in ours(ground, "HEARTBEAT") if beat.time >= quiet_from}
        expect(states == {mavlink.MAV_STATE_ACTIVE}, f"system status {states}")

    def status():
        quiet = [frame for frame in ours(ground, "GIMBAL_MANAGER_STATUS") if frame.time >= quiet_from]
        gaps = sorted(after.time - before.time for before, after in pairwise(quiet))
        rate = (len(quiet) - 1) / (quiet[-1].time - quiet[0].time)
        expect(abs(rate - 5) < 0.25, f"{rate:.2f} a second")
        expect(abs(gaps[len(gaps) // 2] - 0.2) < 0.02, f"the usual gap is {gaps[len(gaps) // 2]:.3f} s")
        for frame in quiet:
            told = frame.message
            owners = told.primary_control_sysid, told.primary_control_compid
            others = told.secondary_control_sysid, told.secondary_control_compid
            expect((told.gimbal_device_id, owners, others) == (DEVICE, (0, 0), (0, 0)), str(told))
            wanted = LOCK | YAW_IN_EARTH_FRAME
            expect(told.flags & wanted == wanted and not told.flags & YAW_IN_VEHICLE_FRAME, f"flags {told.flags}")
        return f"{rate:.2f} a second"

    def information():
        told = [frame.message for frame in ours(ground + client_frames(client), "GIMBAL_MANAGER_INFORMATION")]
        expect(told, "none")
        device = client.last("GIMBAL_DEVICE_INFORMATION")
        for message in told:
            expect(message.gimbal_device_id == DEVICE, f"device {message.gimbal_device_id}")
            for limit in ("roll_min", "roll_max", "pitch_min", "pitch_max"):
                same = math.isclose(getattr(message, limit), getattr(device, limit), abs_tol=1e-6)
                expect(same, f"{limit} is not the device's {getattr(device, limit)}: {message}")
            # The simulated device turns without end; a slider in a ground station needs numbers.
            expect(math.isclose(message.yaw_min, -math.pi, abs_tol=1e-6), f"yaw_min {message.yaw_min}")
            expect(math.isclose(message.yaw_max, math.pi, abs_tol=1e-6), f"yaw_max {message.yaw_max}")
            # A place on the map from when the vehicle's is known.
            aims = mavlink.GIMBAL_MANAGER_CAP_FLAGS_CAN_POINT_LOCATION_LOCAL
            places = mavlink.GIMBAL_MANAGER_CAP_FLAGS_CAN_POINT_LOCATION_GLOBAL
            allowed = {device.cap_flags | aims, device.cap_flags | aims | places}
            expect(message.cap_flags in allowed, f"{message.cap_flags:#x}, {device.cap_flags:#x}")
        expect(told[-1].cap_flags & places, f"cannot point at a place: {told[-1].cap_flags:#x}")

    def setpoints():
        sent = [frame.message for frame in ours(serial, "GIMBAL_DEVICE_SET_ATTITUDE")]
        expect(len(sent) > 20, f"only {len(sent)} of them")
        for message in sent:
            expect((message.target_system, message.target_component) == GIMBAL, f"to another: {message}")
            frames = message.flags & (YAW_IN_VEHICLE_FRAME | YAW_IN_EARTH_FRAME)
            expect(frames in (YAW_IN_VEHICLE_FRAME, YAW_IN_EARTH_FRAME), f"not exactly one frame: {message}")
            locked = bool(message.flags & mavlink.GIMBAL_DEVICE_FLAGS_YAW_LOCK)
            expect(locked == (frames == YAW_IN_EARTH_FRAME), f"lock and frame differ: {message}")
            length = math.sqrt(sum(part * part for part in message.q))
            rates = (message.angular_velocity_x, message.angular_velocity_y, message.angular_velocity_z)
            nothing = math.isnan(length) and all(map(math.isnan, rates))
            retracted = message.flags & (mavlink.GIMBAL_DEVICE_FLAGS_NEUTRAL | mavlink.GIMBAL_DEVICE_FLAGS_RETRACT)
            expect(not nothing or retracted, f"it demands nothing: {message}")
            expect(math.isnan(length) or abs(length - 1) < 1e-3, f"no attitude: {message}")
        elsewhere = [frame for frame in ground + autopilot if frame.name == "GIMBAL_DEVICE_SET_ATTITUDE"]
        expect(not elsewhere, f"{len(elsewhere)} went to other links")
        return f"{len(sent)} of them"

    def answers():
        for at, ack in client.heard("COMMAND_ACK"):
            expect((ack.target_system, ack.target_component) == CLIENT, f"for another: {ack}")
            expect(ack.result != mavlink.MAV_RESULT_IN_PROGRESS, f"in progress: {ack}")
        elsewhere = ours(ground + autopilot + serial, "COMMAND_ACK")
        strays = [frame for frame in elsewhere if frame.message.target_system == CLIENT[0]]
        expect(not strays, f"{len(strays)} answers to the client went to other links")

    def telemetry():
        names = ("ATTITUDE", "GLOBAL_POSITION_INT", "HEARTBEAT")
        arrived = {frame.bytes for frame in ground if frame.source == VEHICLE}
        # The last ones may still have been on their way.
        sent = [frame for frame in vehicle_sent if frame.name in names and quiet_from <= frame.time <= quiet_to - 0.5]
        lost = [frame for frame in sent if frame.bytes not in arrived]
        expect(len(sent) > 30, f"the vehicle sent only {len(sent)}")
        expect(not lost, f"{len(lost)} of {len(sent)} lost or changed, such as {lost[:1]}")
        made_up = arrived - {frame.bytes for frame in vehicle_sent}
        expect(not made_up, f"{len(made_up)} that the vehicle did not send")
        return f"{len(sent)} frames"

    steps.run("sequence numbers go up by one per component and link", sequence_numbers)
    steps.run("all of the manager's frames are MAVLink 2 without trailing zeros", in_mavlink_2)
    steps.run("HEARTBEAT says onboard controller, once a second on each link", heartbeat)
    steps.run("GIMBAL_MANAGER_STATUS comes five times a second", status)
    steps.run("GIMBAL_MANAGER_INFORMATION is the device's", information)
    steps.run("setpoints go to the gimbal only, with one frame", setpoints)
    steps.run("answers go to who asked only", answers)
    steps.run("the vehicle's telemetry goes through byte for byte", telemetry)
    steps.run("the client could decode all that it heard", client.check)
    steps.run("the daemon is well", rig.daemon.check)


def gimbal_knows_heading(client):
    seen = client.attitudes.since(0)
    return seen and not math.isnan(seen[-1].yaw_north)


def client_frames(client):
    return [Frame(at, message) for at, message in client.heard("GIMBAL_MANAGER_INFORMATION")]


def main():
    steps = Steps(f"pymavlink {pymavlink.__version__} listener")

    def run():
        with Rig("pymavlink-listener", SYSTEM_ID, "ardupilot") as rig, Listener(rig.listener_port) as listener:
            with GroundStation(rig.ground_port, CLIENT[0], SYSTEM_ID) as client:
                # An ArduPilot does not tell gimbals where it points until somebody asks it to.
                wait_for("the gimbal told the heading", lambda: gimbal_knows_heading(client), 15)
                body(steps, rig, listener, client)

    steps.script(run)


main()
