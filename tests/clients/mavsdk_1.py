"""MAVSDK 1.4, which many scripts still use: ownership, angles, rates and release through its own server.

It can only listen, so the daemon speaks first.
"""

import asyncio
import pathlib
import socket
import threading
from importlib.metadata import version

import mavsdk
from mavsdk.gimbal import ControlMode, GimbalMode

from attitudes import Attitudes
from rig import LOGS, Process, Rig, free_port
from steps import Steps, expect, wait_for

OWN_IDS = (245, 190)
TURN_RATE_DPS = 7.16


class Client:
    """The library on an event loop of its own thread, so that a script can wait for it with deadlines."""

    def __init__(self, server_port):
        self._loop = asyncio.new_event_loop()
        threading.Thread(target=self._loop.run_forever, daemon=True).start()
        self.drone = mavsdk.System("localhost", server_port)
        self.attitudes = Attitudes()
        self.control = None
        self.call(self.drone.connect(), 20)

    def call(self, coroutine, timeout=5):
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop).result(timeout)

    def follow_streams(self):
        for stream in (self._follow_attitude(), self._follow_control()):
            asyncio.run_coroutine_threadsafe(stream, self._loop)

    async def wait_connected(self):
        async for state in self.drone.core.connection_state():
            if state.is_connected:
                return

    async def _follow_attitude(self):
        async for angles in self.drone.telemetry.camera_attitude_euler():
            # It hands on the yaw as it came; the simulated gimbal gives it from North.
            self.attitudes.add(angles.pitch_deg, yaw_north=angles.yaw_deg)

    async def _follow_control(self):
        async for control in self.drone.gimbal.control():
            primary = (control.sysid_primary_control, control.compid_primary_control)
            self.control = (control.control_mode, primary)

    def wait_owner(self, mode, primary):
        wait_for(
            lambda: f"control {mode} with primary {primary}; it is {self.control}",
            lambda: self.control == (mode, primary),
            3,
        )


def body(steps, rig, server):
    grpc_port = server.grpc_port
    client = None

    def connects():
        nonlocal client
        client = Client(grpc_port)
        client.call(client.wait_connected(), 10)
        client.follow_streams()

    def attitude_comes():
        seen = client.attitudes.watch(2.0)
        expect(len(seen) >= 8, f"{len(seen)} attitudes in 2 s")

    def takes_control():
        client.call(client.drone.gimbal.take_control(ControlMode.PRIMARY))
        client.wait_owner(ControlMode.PRIMARY, OWN_IDS)
        expect(rig.gimbal()["primary"] == "{}/{}".format(*OWN_IDS), f"the page says {rig.gimbal()['primary']}")

    def at(pitch, yaw):
        attitude = rig.gimbal()["attitude"]
        return abs(attitude["pitch_deg"] - pitch) < 1 and abs(attitude["yaw_vehicle_deg"] - yaw) < 1

    def sets_angles():
        client.call(client.drone.gimbal.set_mode(GimbalMode.YAW_FOLLOW))
        for pitch, yaw in [(-30, 20), (-60, -45), (10, 0)]:
            client.call(client.drone.gimbal.set_pitch_and_yaw(pitch, yaw))
            client.attitudes.wait_at(pitch=pitch)
            wait_for(lambda: f"{pitch}°, {yaw}° on the page: {rig.gimbal()['attitude']}", lambda: at(pitch, yaw), 5)

    def locks():
        client.call(client.drone.gimbal.set_mode(GimbalMode.YAW_LOCK))
        client.call(client.drone.gimbal.set_pitch_and_yaw(-5, 120))
        client.attitudes.wait_at(pitch=-5, yaw_north=120)
        for seen in client.attitudes.watch(2.0):
            expect(abs(seen.yaw_north - 120) < 1, f"it did not stay: {seen}")
        client.call(client.drone.gimbal.set_mode(GimbalMode.YAW_FOLLOW))

    def turns():
        client.call(client.drone.gimbal.set_pitch_and_yaw(20, 0))
        client.attitudes.wait_at(pitch=20)
        client.call(client.drone.gimbal.set_pitch_rate_and_yaw_rate(-10, 0))
        rate = client.attitudes.rate("pitch", 1.5)
        expect(abs(rate + 10) < 1.5, f"pitch turns at {rate:.2f} °/s")
        client.call(client.drone.gimbal.set_pitch_rate_and_yaw_rate(0, 0))
        client.attitudes.wait_still("pitch", 2)
        client.call(client.drone.gimbal.set_pitch_rate_and_yaw_rate(0, 15))
        rate = client.attitudes.rate("yaw_north", 1.0) - TURN_RATE_DPS
        expect(abs(rate - 15) < 3, f"yaw turns at {rate:.2f} °/s against the vehicle")
        client.call(client.drone.gimbal.set_pitch_rate_and_yaw_rate(0, 0))

    def points_at_roi():
        client.call(client.drone.gimbal.set_roi_location(47.397742, 8.545594, 0))
        client.attitudes.wait_at(pitch=-51.34)
        expect(rig.gimbal()["roi"] is not None, "the page shows no ROI")

    def releases():
        client.call(client.drone.gimbal.release_control())
        client.wait_owner(ControlMode.NONE, (0, 0))
        expect(rig.gimbal()["primary"] is None, f"the page says {rig.gimbal()['primary']}")

    steps.run("connects", connects, essential=True)
    steps.run("sees the attitude", attitude_comes)
    steps.run("takes control", takes_control)
    steps.run("sets angles", sets_angles)
    steps.run("locks yaw", locks)
    steps.run("turns at a rate and stops", turns)
    steps.run("points at a location", points_at_roi)
    steps.run("releases control", releases)
    steps.run("the daemon is well", rig.daemon.check)


class Server(Process):
    """The server that comes with the library."""

    def __init__(self, listen_port):
        self.grpc_port = free_port(socket.SOCK_STREAM)
        binary = pathlib.Path(mavsdk.__file__).parent / "bin/mavsdk_server"
        arguments = [str(binary), "-p", str(self.grpc_port), f"udp://:{listen_port}"]
        super().__init__("mavsdk_server", arguments, LOGS / "mavsdk-1-server.log")


def main():
    steps = Steps(f"MAVSDK {version('mavsdk')}")

    def run():
        with Rig("mavsdk-1") as rig:
            server = Server(rig.listener_port)
            try:
                body(steps, rig, server)
            finally:
                server.kill()

    steps.script(run)


main()
