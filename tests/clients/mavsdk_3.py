"""MAVSDK 3: every call of its gimbal plugin through its own server.

Client checklist E136: "the same, with the gimbal id taken from the attitude stream": the id that it lists is not the one
that its calls take.
"""

import time
import warnings
from importlib.metadata import version

# Importing it says that the package has another name by now.
warnings.filterwarnings("ignore", category=FutureWarning)

from mavsdk.gimbal import ControlMode, GimbalError, GimbalMode, GimbalResult, SendMode  # noqa: E402

import gimbals  # noqa: E402
from attitudes import Attitudes  # noqa: E402
from mavsdk_server import Library, Server  # noqa: E402
from mavsdk_steps import Client, Vocabulary, demands  # noqa: E402
from rig import Rig  # noqa: E402
from steps import Failure, Steps, expect, wait_for  # noqa: E402

Result = GimbalResult.Result


class Remote(Client):
    def __init__(self, server):
        self.library = Library(server.grpc_port)
        self.plugin = self.library.drone.gimbal
        self.attitudes = Attitudes()
        self.gimbal_id = None
        self.listed = None
        self.connected_at = time.monotonic()
        self.library.follow(self.plugin.gimbal_list(), self._handle_list)
        self.library.follow(self.plugin.attitude(), self._handle_attitude)

    def _handle_list(self, update):
        if update.gimbals and self.listed is None:
            self.listed = (time.monotonic(), update.gimbals)

    def _handle_attitude(self, attitude):
        self.gimbal_id = attitude.gimbal_id
        forward, north = attitude.euler_angle_forward, attitude.euler_angle_north
        self.attitudes.add(forward.pitch_deg, forward.yaw_deg, north.yaw_deg, forward.roll_deg)

    def _id(self, everybody):
        return 0 if everybody else self.gimbal_id

    def take(self, everybody=False):
        self.library.call(self.plugin.take_control(self._id(everybody), ControlMode.PRIMARY))

    def release(self, everybody=False):
        self.library.call(self.plugin.release_control(self._id(everybody)))

    def angles(self, pitch, yaw, lock=False, once=True, roll=0, everybody=False):
        call = self.plugin.set_angles(self._id(everybody), roll, pitch, yaw, mode(lock), send_mode(once))
        self.library.call(call)

    def rates(self, pitch, yaw, lock=False, once=True, everybody=False):
        call = self.plugin.set_angular_rates(self._id(everybody), 0, pitch, yaw, mode(lock), send_mode(once))
        self.library.call(call)

    def roi(self, latitude, longitude, altitude, everybody=False):
        self.library.call(self.plugin.set_roi_location(self._id(everybody), latitude, longitude, altitude))

    def owner(self):
        status = self.library.call(self.plugin.get_control_status(self.gimbal_id))
        return (
            status.control_mode.name,
            (status.sysid_primary_control, status.compid_primary_control),
            (status.sysid_secondary_control, status.compid_secondary_control),
        )

    def expect_refused(self, call):
        expect_error(Result.ERROR, call)


def mode(lock):
    return GimbalMode.YAW_LOCK if lock else GimbalMode.YAW_FOLLOW


def send_mode(once):
    return SendMode.ONCE if once else SendMode.STREAM


def expect_error(result, call):
    try:
        call()
    except GimbalError as error:
        expect(error._result.result == result, f"it ended as {error}")
    else:
        raise Failure("it was accepted")


def body(steps, rig, server, wire):
    client = Remote(server)

    def lists():
        at, gimbals = wait_for("a gimbal in the list", lambda: client.listed, 10)
        shown = [(g.gimbal_manager_component_id, g.gimbal_device_id) for g in gimbals]
        expect(shown == [rig.kind.ids], f"listed {shown}")
        took = at - client.connected_at
        expect(took < 2.0, f"listed {took:.2f} s after connecting")
        wait_for("the id in the stream of attitudes", lambda: client.gimbal_id, 5)
        return f"{took:.2f} s after connecting, as {gimbals[0].gimbal_id}, to be called {client.gimbal_id}"

    def asks_once():
        attitude = client.library.call(client.plugin.get_attitude(client.gimbal_id))
        pitch = attitude.euler_angle_forward.pitch_deg
        expect(abs(pitch - rig.camera.last().pitch) < 1, f"a pitch of {pitch}° at {rig.camera.last()}")

    def refuses_itself():
        """What the library itself cannot do; nothing of it goes out."""
        before = len(demands(wire))
        plugin, call, own = client.plugin, client.library.call, client.gimbal_id
        expect_error(Result.UNSUPPORTED, lambda: call(plugin.take_control(own, ControlMode.SECONDARY)))
        expect_error(Result.INVALID_ARGUMENT, lambda: client.angles(0, 0, roll=5))
        sent = demands(wire)[before:]
        expect(not sent, f"it sent {sent[:1]}")

    steps.run("lists the gimbal in under 2 s", lists, essential=True)
    steps.run("asks for the attitude", asks_once)
    Vocabulary(steps, rig, client, wire).run()
    steps.run("sends nothing of what it refuses itself", refuses_itself)
    client.library.close()


def main():
    gimbal = gimbals.chosen()
    steps = Steps(f"MAVSDK {version('mavsdk')}{gimbal.suffix}")

    def run():
        with Rig("mavsdk-3", gimbal=gimbal) as rig:
            wire = rig.ground_wire()
            with Server(f"udpout://127.0.0.1:{wire.port}", "mavsdk-3-server.log") as server:
                body(steps, rig, server, wire)

    steps.script(run)


main()
