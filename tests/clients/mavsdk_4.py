"""MAVSDK 4, the native library: every call of its gimbal plugin, with PX4 and with ArduPilot.

Client checklist E135: "list, take control, angles, rates, lock, ROI, attitude, status, release with the real library all
succeed."
"""

import time

import mavsdk
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.gimbal import ControlMode, Gimbal, GimbalError, GimbalMode, GimbalResult, SendMode

import gimbals
from attitudes import Attitudes
from mavsdk_steps import NOBODY, Client, Vocabulary, demands, name
from rig import Rig
from steps import Failure, Steps, expect, wait_for


class Native(Client):
    """One MAVSDK with its gimbal plugin."""

    def __init__(self, port, configuration=None):
        self._configuration = configuration or Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        self.ids = (self._configuration.system_id, self._configuration.component_id)
        self._mavsdk = Mavsdk(self._configuration)
        self._listed = None
        # Set by `find_gimbal`.
        self.gimbal_id = None
        self.attitudes = Attitudes()
        self.statuses = []
        self.connecting_at = time.monotonic()
        self._mavsdk.add_any_connection(f"udpout://127.0.0.1:{port}")
        system = self._mavsdk.first_autopilot(5.0)
        expect(system is not None, "no autopilot within 5 s")
        self.connected_at = time.monotonic()
        self.plugin = Gimbal(system)
        self.plugin.subscribe_gimbal_list(self._handle_list)
        self.plugin.subscribe_attitude(self._handle_attitude)
        self.plugin.subscribe_control_status(lambda status, _: self.statuses.append(status))

    def find_gimbal(self):
        """When the gimbal was listed, and as what."""
        at, gimbals = wait_for("a gimbal in the list", lambda: self._listed, 10)
        self.gimbal_id = gimbals[0].gimbal_id
        return at, gimbals

    def close(self):
        self._mavsdk.destroy()

    def _handle_list(self, update, _):
        if update.gimbals and self._listed is None:
            self._listed = (time.monotonic(), update.gimbals)

    def _handle_attitude(self, attitude, _):
        forward, north = attitude.euler_angle_forward, attitude.euler_angle_north
        self.attitudes.add(forward.pitch_deg, forward.yaw_deg, north.yaw_deg, forward.roll_deg)

    def _id(self, everybody):
        return 0 if everybody else self.gimbal_id

    def take(self, everybody=False):
        self.plugin.take_control(self._id(everybody), ControlMode.PRIMARY)

    def release(self, everybody=False):
        self.plugin.release_control(self._id(everybody))

    def angles(self, pitch, yaw, lock=False, once=True, roll=0, everybody=False):
        self.plugin.set_angles(self._id(everybody), roll, pitch, yaw, mode(lock), send_mode(once))

    def rates(self, pitch, yaw, lock=False, once=True, everybody=False):
        self.plugin.set_angular_rates(self._id(everybody), 0, pitch, yaw, mode(lock), send_mode(once))

    def roi(self, latitude, longitude, altitude, everybody=False):
        self.plugin.set_roi_location(self._id(everybody), latitude, longitude, altitude)

    def owner(self):
        return seen_control(self.plugin.get_control_status(self.gimbal_id))

    def expect_refused(self, call):
        expect_error(GimbalResult.ERROR, call)


def mode(lock):
    return GimbalMode.YAW_LOCK if lock else GimbalMode.YAW_FOLLOW


def send_mode(once):
    return SendMode.ONCE if once else SendMode.STREAM


def seen_control(status):
    return (
        status.control_mode.name if hasattr(status.control_mode, "name") else ControlMode(status.control_mode).name,
        (status.sysid_primary_control, status.compid_primary_control),
        (status.sysid_secondary_control, status.compid_secondary_control),
    )


def expect_error(result, call):
    try:
        call()
    except GimbalError as error:
        expect(error.result == result, f"it ended as {error}")
    else:
        raise Failure("it was accepted")


def lists(client, kind):
    """Client checklist E139: "`list` ends in < 2 s"."""
    at, gimbals = client.find_gimbal()
    took = at - client.connected_at
    shown = [(g.vendor_name, g.model_name, g.gimbal_manager_component_id, g.gimbal_device_id) for g in gimbals]
    expect(shown == [(kind.vendor, kind.model, *kind.ids)], f"listed {shown}")
    expect(took < 2.0, f"listed {took:.2f} s after connecting")
    return f"{took:.2f} s after connecting, {at - client.connecting_at:.2f} s after opening the port"


def body(steps, rig):
    wire = rig.ground_wire()
    client = Native(wire.port)

    def asks_once():
        """The calls that ask, beside the streams."""
        expect([g.gimbal_id for g in client.plugin.gimbal_list().gimbals] == [client.gimbal_id], "not the same list")
        client.attitudes.watch(0.3)
        pitch = client.plugin.get_attitude(client.gimbal_id).euler_angle_forward.pitch_deg
        expect(abs(pitch - rig.camera.last().pitch) < 1, f"a pitch of {pitch}° at {rig.camera.last()}")
        wait_for("control in a stream", lambda: client.statuses, 2)
        expect(seen_control(client.statuses[-1]) == client.owner(), "the stream of control tells another owner")

    def refuses_itself():
        """What the library itself cannot do; nothing of it goes out."""
        before = len(demands(wire))
        gimbal, own = client.plugin, client.gimbal_id
        expect_error(GimbalResult.UNSUPPORTED, lambda: gimbal.take_control(own, ControlMode.SECONDARY))
        follow, once = GimbalMode.YAW_FOLLOW, SendMode.ONCE
        expect_error(GimbalResult.INVALID_ARGUMENT, lambda: gimbal.set_angles(own, 5, 0, 0, follow, once))
        expect_error(GimbalResult.INVALID_ARGUMENT, lambda: gimbal.set_angular_rates(own, 5, 0, 0, follow, once))
        expect_error(GimbalResult.INVALID_ARGUMENT, lambda: gimbal.set_angles(own + 1, 0, 0, 0, follow, once))
        sent = demands(wire)[before:]
        expect(not sent, f"it sent {sent[:1]}")

    def another_library_takes_over():
        second = Native(rig.ground_port, Configuration.create_manual(246, 190, True))
        try:
            second.find_gimbal()
            client.take()
            second.take()
            second.wait_owner("PRIMARY", second.ids, second.ids)
            second.angles(-20, 15)
            rig.camera.wait_at(pitch=-20, yaw_vehicle=15)
            client.wait_owner("NONE", second.ids, second.ids)
            client.expect_refused(lambda: client.angles(10, -40))
            rig.camera.expect_still(1.0, pitch=-20, yaw_vehicle=15)
            rig.wait_owners(name(second.ids), name(second.ids))
            second.release()
            client.wait_owner("NONE", NOBODY, NOBODY)
        finally:
            second.close()

    steps.run("lists the gimbal in under 2 s", lambda: lists(client, rig.kind), essential=True)
    steps.run("asks for list, attitude and control", asks_once)
    Vocabulary(steps, rig, client, wire).run()
    steps.run("another MAVSDK takes control over", another_library_takes_over)
    steps.run("sends nothing of what it refuses itself", refuses_itself)
    client.close()


def body_with_ardupilot(steps, rig):
    """There it fills unused parameters with 0 instead of NaN."""
    wire = rig.ground_wire()
    client = Native(wire.port)
    steps.run("lists the gimbal in under 2 s", lambda: lists(client, rig.kind), essential=True)
    Vocabulary(steps, rig, client, wire).run_in_short()
    client.close()


def main():
    gimbal = gimbals.chosen()
    steps = Steps(f"MAVSDK {mavsdk.__version__}{gimbal.suffix}")

    def run():
        with Rig("mavsdk-4", gimbal=gimbal) as rig:
            body(steps, rig)
        if gimbal is not gimbals.MAVLINK_V2:
            return
        steps.prefix += " with ArduPilot"
        with Rig("mavsdk-4-ardupilot", autopilot="ardupilot") as rig:
            body_with_ardupilot(steps, rig)

    steps.script(run)


main()
