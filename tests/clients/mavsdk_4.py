"""MAVSDK 4: discovery, ownership, angles, lock, rates, ROI and release by the native library."""

import time

import mavsdk
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.gimbal import ControlMode, Gimbal, GimbalError, GimbalMode, GimbalResult, SendMode

from attitudes import Attitudes
from rig import Rig
from steps import Failure, Steps, expect, wait_for

FOLLOW, LOCK = GimbalMode.YAW_FOLLOW, GimbalMode.YAW_LOCK
ONCE, STREAM = SendMode.ONCE, SendMode.STREAM

# The simulated vehicle flies a circle of 40 m around home, 50 m above it, to the right.
TURN_RATE_DPS = 7.16
HOME = (47.397742, 8.545594)
PITCH_TO_HOME = -51.34


class Client:
    """One MAVSDK with its gimbal plugin."""

    def __init__(self, port, configuration):
        self.ids = (configuration.system_id, configuration.component_id)
        self.mavsdk = Mavsdk(configuration)
        self.gimbal = None
        self.listed = None
        self.attitudes = Attitudes()
        self.connecting_at = time.monotonic()
        self.mavsdk.add_any_connection(f"udpout://127.0.0.1:{port}")
        self.system = self.mavsdk.first_autopilot(5.0)
        self.connected_at = time.monotonic()

    def find_gimbal(self):
        expect(self.system is not None, "no autopilot within 5 s")
        self.gimbal = Gimbal(self.system)
        self.gimbal.subscribe_gimbal_list(self._handle_list)
        self.gimbal.subscribe_attitude(self._handle_attitude)
        return wait_for("a gimbal in the list", lambda: self.listed, 10)

    def _handle_list(self, update, _):
        if update.gimbals and self.listed is None:
            self.listed = (time.monotonic(), update.gimbals)

    def _handle_attitude(self, attitude, _):
        forward, north = attitude.euler_angle_forward, attitude.euler_angle_north
        self.attitudes.add(forward.pitch_deg, forward.yaw_deg, north.yaw_deg)

    def owner(self, gimbal_id):
        """How this client sees its own control, and who has primary control."""
        status = self.gimbal.get_control_status(gimbal_id)
        return status.control_mode, (status.sysid_primary_control, status.compid_primary_control)

    def wait_owner(self, gimbal_id, mode, primary):
        wait_for(
            lambda: f"control status {mode.name} with primary {primary}; it is {self.owner(gimbal_id)}",
            lambda: self.owner(gimbal_id) == (mode, primary),
            2,
        )


def refused(call):
    try:
        call()
    except GimbalError as error:
        expect(error.result == GimbalResult.ERROR, f"refused as {error}")
    else:
        raise Failure("it was accepted")


def body(steps, rig):
    first = Client(rig.ground_port, Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    gimbal_id = 0

    def lists():
        nonlocal gimbal_id
        at, gimbals = first.find_gimbal()
        took = at - first.connected_at
        shown = [(g.vendor_name, g.model_name, g.gimbal_manager_component_id, g.gimbal_device_id) for g in gimbals]
        expect(shown == [("gimbald", "Simulated v2", 191, 154)], f"listed {shown}")
        expect(took < 2.0, f"listed {took:.2f} s after connecting")
        gimbal_id = gimbals[0].gimbal_id
        return f"{took:.2f} s after connecting, {at - first.connecting_at:.2f} s after opening the port"

    steps.run("lists the gimbal in under 2 s", lists, essential=True)
    gimbal = first.gimbal

    def attitude_comes():
        seen = first.attitudes.watch(2.0)
        expect(len(seen) >= 8, f"{len(seen)} attitudes in 2 s")
        return f"{len(seen) / 2:.0f} a second"

    def takes_control():
        gimbal.take_control(gimbal_id, ControlMode.PRIMARY)
        first.wait_owner(gimbal_id, ControlMode.PRIMARY, first.ids)
        expect(rig.gimbal()["primary"] == "{}/{}".format(*first.ids), f"the page says {rig.gimbal()['primary']}")

    def sets_angles():
        for pitch, yaw in [(-30, 20), (-60, -45), (10, 0)]:
            gimbal.set_angles(gimbal_id, 0, pitch, yaw, FOLLOW, ONCE)
            first.attitudes.wait_at(pitch=pitch, yaw_vehicle=yaw)

    def streams_angles():
        for pitch, yaw in [(-10, 10), (-12, 12), (-14, 14)]:
            gimbal.set_angles(gimbal_id, 0, pitch, yaw, FOLLOW, STREAM)
        first.attitudes.wait_at(pitch=-14, yaw_vehicle=14)

    def follows():
        rate = first.attitudes.rate("yaw_north")
        expect(abs(rate - TURN_RATE_DPS) < 1, f"turns at {rate:.2f} °/s over ground, the vehicle at {TURN_RATE_DPS}")

    def locks():
        for yaw in (0, 90, 180, -90):
            gimbal.set_angles(gimbal_id, 0, -5, yaw, LOCK, ONCE)
            first.attitudes.wait_at(pitch=-5, yaw_north=yaw)
        rate = first.attitudes.rate("yaw_vehicle")
        expect(abs(rate + TURN_RATE_DPS) < 1, f"turns at {rate:.2f} °/s against the vehicle")
        first.attitudes.wait_at(pitch=-5, yaw_north=-90)

    def turns_once():
        gimbal.set_angles(gimbal_id, 0, 20, 0, FOLLOW, ONCE)
        first.attitudes.wait_at(pitch=20, yaw_vehicle=0)
        gimbal.set_angular_rates(gimbal_id, 0, -10, 5, FOLLOW, ONCE)
        pitch_rate = first.attitudes.rate("pitch")
        expect(abs(pitch_rate + 10) < 1, f"pitch turns at {pitch_rate:.2f} °/s")
        yaw_rate = first.attitudes.rate("yaw_vehicle")
        expect(abs(yaw_rate - 5) < 1, f"yaw turns at {yaw_rate:.2f} °/s")
        gimbal.set_angular_rates(gimbal_id, 0, 0, 0, FOLLOW, ONCE)
        first.attitudes.wait_still("pitch", 2)
        first.attitudes.wait_still("yaw_vehicle", 2)

    def streamed_rate_ends():
        gimbal.set_angular_rates(gimbal_id, 0, 0, 15, FOLLOW, STREAM)
        rate = first.attitudes.rate("yaw_vehicle", 1.0)
        expect(abs(rate - 15) < 3, f"yaw turns at {rate:.2f} °/s")
        # [control] rate_timeout_s is 2.
        first.attitudes.wait_still("yaw_vehicle", 4)

    def points_at_roi():
        gimbal.set_roi_location(gimbal_id, *HOME, 0)
        first.attitudes.wait_at(pitch=PITCH_TO_HOME, yaw_vehicle=90, within=3)
        roi = rig.gimbal()["roi"]
        expect(roi is not None, "the page shows no ROI")
        gimbal.set_angles(gimbal_id, 0, 0, 0, FOLLOW, ONCE)
        first.attitudes.wait_at(pitch=0, yaw_vehicle=0)
        expect(rig.gimbal()["roi"] is None, "the page still shows a ROI")

    def addresses_everybody():
        gimbal.set_angles(0, 0, -8, 8, FOLLOW, ONCE)
        first.attitudes.wait_at(pitch=-8, yaw_vehicle=8)

    def releases():
        gimbal.release_control(gimbal_id)
        first.wait_owner(gimbal_id, ControlMode.NONE, (0, 0))
        expect(rig.gimbal()["primary"] is None, f"the page says {rig.gimbal()['primary']}")

    steps.run("sees the attitude", attitude_comes)
    steps.run("takes control", takes_control)
    steps.run("sets angles", sets_angles)
    steps.run("streams angles", streams_angles)
    steps.run("follows the vehicle", follows)
    steps.run("locks yaw to North, East, South and West", locks)
    steps.run("turns at a rate and stops", turns_once)
    steps.run("a streamed rate ends by itself", streamed_rate_ends)
    steps.run("points at a location", points_at_roi)
    steps.run("addresses every gimbal with id 0", addresses_everybody)
    steps.run("releases control", releases)

    second = Client(rig.ground_port, Configuration.create_manual(246, 190, True))

    def second_takes_control():
        second.find_gimbal()
        second.gimbal.take_control(gimbal_id, ControlMode.PRIMARY)
        second.wait_owner(gimbal_id, ControlMode.PRIMARY, second.ids)
        second.gimbal.set_angles(gimbal_id, 0, -20, 15, FOLLOW, ONCE)
        second.attitudes.wait_at(pitch=-20, yaw_vehicle=15)

    def owner_is_visible():
        first.wait_owner(gimbal_id, ControlMode.NONE, second.ids)

    def setpoints_are_refused():
        refused(lambda: gimbal.set_angles(gimbal_id, 0, 10, -40, FOLLOW, ONCE))
        refused(lambda: gimbal.set_angular_rates(gimbal_id, 0, 20, 20, FOLLOW, ONCE))
        refused(lambda: gimbal.set_roi_location(gimbal_id, *HOME, 0))
        gimbal.set_angles(gimbal_id, 0, 10, -40, FOLLOW, STREAM)  # a message: there is no answer to it
        for seen in first.attitudes.watch(2.0):
            expect(abs(seen.pitch + 20) < 1 and abs(seen.yaw_vehicle - 15) < 1, f"the camera moved: {seen}")
        rejected = rig.gimbal()["rejected"]
        name = "{}/{}".format(*first.ids)
        count = sum(rejected.get(name, {}).values())
        expect(count == 4, f"the page should count 4 refusals of {name}: {rejected}")

    def steers_again():
        second.gimbal.release_control(gimbal_id)
        first.wait_owner(gimbal_id, ControlMode.NONE, (0, 0))
        gimbal.set_angles(gimbal_id, 0, 5, -5, FOLLOW, ONCE)
        first.attitudes.wait_at(pitch=5, yaw_vehicle=-5)

    steps.run("another client takes control", second_takes_control, essential=True)
    steps.run("sees who has control", owner_is_visible)
    steps.run("is refused while another has control", setpoints_are_refused)
    steps.run("steers again after the other's release", steers_again)
    steps.run("the daemon is well", rig.daemon.check)
    second.mavsdk.destroy()
    first.mavsdk.destroy()


def main():
    steps = Steps(f"MAVSDK {mavsdk.__version__}")

    def run():
        with Rig("mavsdk-4") as rig:
            body(steps, rig)

    steps.script(run)


main()
