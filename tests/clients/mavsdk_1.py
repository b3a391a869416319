"""MAVSDK 1.4, which many scripts still use: every call of its gimbal plugin through its own server.

Client checklist E137: the same as with newer ones. It can only listen, so the daemon speaks first.
"""

from importlib.metadata import version

from mavsdk.gimbal import ControlMode, GimbalError, GimbalMode, GimbalResult

import gimbals
from attitudes import Attitudes
from mavsdk_server import Library, Server
from mavsdk_steps import Client, Vocabulary
from rig import Rig
from steps import Failure, Steps, expect


class Remote(Client):
    has_commands = False

    def __init__(self, server, rig):
        self._rig = rig
        self.library = Library(server.grpc_port)
        self.plugin = self.library.drone.gimbal
        self.attitudes = Attitudes()
        self._control = None
        self.library.follow(self.library.drone.telemetry.camera_attitude_euler(), self._handle_attitude)
        self.library.follow(self.plugin.control(), self._handle_control)

    def _handle_attitude(self, angles):
        # It hands on the yaw as it came, and not from where.
        yaw = self._rig.kind.status_yaw or self._rig.camera.status_yaw
        self.attitudes.add(angles.pitch_deg, roll=angles.roll_deg, **{yaw: angles.yaw_deg})

    def _handle_control(self, control):
        self._control = control

    def take(self, everybody=False):
        self.library.call(self.plugin.take_control(ControlMode.PRIMARY))

    def release(self, everybody=False):
        self.library.call(self.plugin.release_control())

    def angles(self, pitch, yaw, lock=False, once=False, roll=0, everybody=False):
        self._set_mode(lock)
        self.library.call(self.plugin.set_pitch_and_yaw(pitch, yaw))

    def rates(self, pitch, yaw, lock=False, once=False, everybody=False):
        self._set_mode(lock)
        self.library.call(self.plugin.set_pitch_rate_and_yaw_rate(pitch, yaw))

    def roi(self, latitude, longitude, altitude, everybody=False):
        self.library.call(self.plugin.set_roi_location(latitude, longitude, altitude))

    def owner(self):
        control = self._control
        return control and (
            control.control_mode.name,
            (control.sysid_primary_control, control.compid_primary_control),
            (control.sysid_secondary_control, control.compid_secondary_control),
        )

    def expect_refused(self, call):
        try:
            call()
        except GimbalError as error:
            expect(error._result.result == GimbalResult.Result.ERROR, f"it ended as {error}")
        else:
            raise Failure("it was accepted")

    def _set_mode(self, lock):
        self.library.call(self.plugin.set_mode(GimbalMode.YAW_LOCK if lock else GimbalMode.YAW_FOLLOW))


def main():
    gimbal = gimbals.chosen()
    steps = Steps(f"MAVSDK {version('mavsdk')}{gimbal.suffix}")

    def run():
        with Rig("mavsdk-1", gimbal=gimbal) as rig:
            with Server(f"udp://:{rig.listener_port}", "mavsdk-1-server.log") as server:
                clients = []
                steps.run("connects", lambda: clients.append(Remote(server, rig)), essential=True)
                Vocabulary(steps, rig, clients[0], rig.listener).run()
                clients[0].library.close()

    steps.script(run)


main()
