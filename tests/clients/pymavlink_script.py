"""A program of its own on pymavlink: discovery, ownership, angles, lock, rates, ROI and release by raw messages."""

import math
import time

import pymavlink

from ground import FOLLOW, LOCK, NAN, YAW_IN_EARTH_FRAME, YAW_IN_VEHICLE_FRAME, GroundStation, mavlink, quaternion
from rig import Rig
from steps import Steps, expect, wait_for

SYSTEM_ID = 7
DEVICE = 154
ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
TURN_RATE_DPS = 7.16
HOME = (47.397742, 8.545594)
PITCH_TO_HOME = -51.34
NOBODY = (0, 0)


def body(steps, rig, one, two):
    seen = one.attitudes

    def lists():
        wait_for("the manager's HEARTBEAT", lambda: one.heard("HEARTBEAT", (SYSTEM_ID, 191)), 3)
        information = one.request(280, "GIMBAL_MANAGER_INFORMATION")
        expect(information.gimbal_device_id == DEVICE, f"it manages device {information.gimbal_device_id}")
        device = one.request(283, "GIMBAL_DEVICE_INFORMATION", component=DEVICE)
        expect(device.model_name == "Simulated v2", f"its model is {device.model_name!r}")
        for limit in ("roll_min", "roll_max", "pitch_min", "pitch_max"):
            told, real = getattr(information, limit), getattr(device, limit)
            expect(math.isclose(told, real, abs_tol=1e-6), f"{limit}: {told} of the manager, {real} of the device")
        expect((information.yaw_min, information.yaw_max) != (0, 0), "no range for yaw")
        lost = device.cap_flags & ~information.cap_flags
        expect(lost & ~mavlink.GIMBAL_MANAGER_CAP_FLAGS_CAN_POINT_LOCATION_LOCAL == 0, f"capabilities {lost:#x} lost")

    def answers_everybody():
        one.request(280, "GIMBAL_MANAGER_INFORMATION", component=0)

    def takes():
        expect(one.configure(one.ids) == ACCEPTED, "configure")
        one.wait_owner(one.ids)

    def angles_by_command():
        for pitch, yaw in [(-30, 20), (-89, -60), (15, 5)]:
            expect(one.pitchyaw(pitch, yaw) == ACCEPTED, f"{pitch}, {yaw}")
            seen.wait_at(pitch=pitch, yaw_vehicle=yaw)

    def angles_by_message():
        one.set_pitchyaw(-10, 30, flags=FOLLOW | YAW_IN_VEHICLE_FRAME)
        seen.wait_at(pitch=-10, yaw_vehicle=30)
        one.set_attitude(quaternion(-40, -20))
        seen.wait_at(pitch=-40, yaw_vehicle=-20)
        one.set_pitchyaw(pitch=-20)
        seen.wait_at(pitch=-20, yaw_vehicle=-20)

    def locks():
        for flags in (LOCK, LOCK | YAW_IN_EARTH_FRAME):
            for yaw in (0, 135, -100):
                expect(one.pitchyaw(-5, yaw, flags=flags) == ACCEPTED, f"{yaw} with {flags}")
                seen.wait_at(pitch=-5, yaw_north=yaw)
        rate = seen.rate("yaw_vehicle")
        expect(abs(rate + TURN_RATE_DPS) < 1, f"turns at {rate:.2f} °/s against the vehicle")
        seen.wait_at(pitch=-5, yaw_north=-100)

    def rates():
        expect(one.pitchyaw(20, 0) == ACCEPTED, "angles")
        seen.wait_at(pitch=20, yaw_vehicle=0)
        expect(one.pitchyaw(NAN, NAN, -10, 5) == ACCEPTED, "rates")
        pitch_rate, yaw_rate = seen.rate("pitch", 1.5), seen.rate("yaw_vehicle", 1.5)
        expect(abs(pitch_rate + 10) < 1.5, f"pitch turns at {pitch_rate:.2f} °/s")
        expect(abs(yaw_rate - 5) < 1.5, f"yaw turns at {yaw_rate:.2f} °/s")
        expect(one.pitchyaw(NAN, NAN, 0, 0) == ACCEPTED, "stop")
        seen.wait_still("pitch", 2)

    def rate_messages_end():
        one.set_pitchyaw(yaw_rate=20)
        rate = seen.rate("yaw_vehicle", 1.0)
        expect(abs(rate - 20) < 4, f"yaw turns at {rate:.2f} °/s")
        # [control] rate_timeout_s is 2.
        seen.wait_still("yaw_vehicle", 4)

    def points_at_roi():
        latitude, longitude = (round(value * 1e7) for value in HOME)
        frame = mavlink.MAV_FRAME_GLOBAL_RELATIVE_ALT
        one.accepted(
            mavlink.MAV_CMD_DO_SET_ROI_LOCATION, DEVICE, NAN, NAN, NAN, 0, as_int=(frame, latitude, longitude)
        )
        seen.wait_at(pitch=PITCH_TO_HOME, yaw_vehicle=90, within=3)
        one.accepted(mavlink.MAV_CMD_DO_SET_ROI_NONE, DEVICE)
        expect(one.pitchyaw(0, 0) == ACCEPTED, "angles")
        seen.wait_at(pitch=0, yaw_vehicle=0)

    def refuses_others():
        one.wait_owner(one.ids)
        expect(two.pitchyaw(-40, 40) == DENIED, "the command of another was not DENIED")
        two.set_pitchyaw(-40, 40)
        two.set_attitude(quaternion(-40, 40))
        for at in seen.watch(1.5):
            expect(abs(at.pitch) < 1 and abs(at.yaw_vehicle) < 1, f"the camera moved: {at}")
        two.wait_owner(one.ids)
        rejected = rig.gimbal()["rejected"].get("{}/{}".format(*two.ids), {})
        expect(sum(rejected.values()) == 3, f"the page should count 3 refusals: {rejected}")

    def secondary():
        expect(two.configure((-1, -1), two.ids) == ACCEPTED, "configure")
        one.wait_owner(one.ids, two.ids)
        expect(two.configure((-1, -1), (-3, -3)) == ACCEPTED, "release")
        one.wait_owner(one.ids, NOBODY)

    def takes_over():
        expect(two.configure(two.ids) == ACCEPTED, "configure")
        one.wait_owner(two.ids)
        expect(one.pitchyaw(-10, 0) == DENIED, "the former owner was not DENIED")
        expect(one.configure((-3, -3)) == ACCEPTED, "a release by who has no control")
        one.wait_owner(two.ids)

    def releases():
        expect(two.configure((-3, -3), (-3, -3)) == ACCEPTED, "release")
        one.wait_owner(NOBODY)
        two.wait_owner(NOBODY)

    def unknown_commands():
        # A message that nobody here makes, and a command that is for an autopilot.
        result = one.command(mavlink.MAV_CMD_REQUEST_MESSAGE, 11045)
        expect(result == DENIED, f"an unknown message was answered with {result}")
        result = one.command(mavlink.MAV_CMD_NAV_TAKEOFF)
        expect(result == mavlink.MAV_RESULT_UNSUPPORTED, f"a take-off was answered with {result}")

    def answers_quickly():
        slowest = 0.0
        for number in range(50):
            started = time.monotonic()
            expect(one.pitchyaw(-number / 10, 0) == ACCEPTED, "angles")
            slowest = max(slowest, time.monotonic() - started)
        expect(slowest < 0.4, f"an answer took {slowest * 1000:.0f} ms")
        return f"slowest of 50: {slowest * 1000:.0f} ms"

    steps.run("lists the gimbal", lists, essential=True)
    steps.run("asks every component", answers_everybody)
    steps.run("takes control", takes)
    steps.run("sets angles by command", angles_by_command)
    steps.run("sets angles by message", angles_by_message)
    steps.run("locks yaw", locks)
    steps.run("turns at a rate and stops", rates)
    steps.run("the rate of a message ends by itself", rate_messages_end)
    steps.run("points at a location", points_at_roi)
    steps.run("another is refused", refuses_others)
    steps.run("another takes and releases secondary control", secondary)
    steps.run("another takes control over", takes_over)
    steps.run("the other releases control", releases)
    steps.run("gets an answer also to what is not supported", unknown_commands)
    steps.run("gets answers at once", answers_quickly)
    steps.run("could decode all that it heard", lambda: (one.check(), two.check()) and None)
    steps.run("the daemon is well", rig.daemon.check)


def main():
    steps = Steps(f"pymavlink {pymavlink.__version__} script")

    def run():
        with Rig("pymavlink-script", system_id=SYSTEM_ID) as rig:
            port = rig.ground_port
            with GroundStation(port, 255, SYSTEM_ID) as one, GroundStation(port, 254, SYSTEM_ID) as two:
                body(steps, rig, one, two)

    steps.script(run)


main()
