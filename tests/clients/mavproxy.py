"""MAVProxy on a machine without a screen: all that its camera module and its gimbal module can say to a gimbal.

It never takes control, so it can steer as long as nobody has it.
"""

import os
import pathlib
import pickle
import re
import subprocess
import sys
import tempfile
import time
import zipfile
from importlib.metadata import version

from attitudes import slope
from dialect import mavlink
from frames import commands
from ground import GroundStation
from rig import HOME, HOME_AMSL, LOGS, PITCH_TO_HOME, TURN_RATE_DPS, Process, Rig
from steps import Steps, expect, wait_for

IDS = (255, 230)
ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
PITCHYAW = mavlink.MAV_CMD_DO_GIMBAL_MANAGER_PITCHYAW
ROI_LOCATION, ROI_NONE = mavlink.MAV_CMD_DO_SET_ROI_LOCATION, mavlink.MAV_CMD_DO_SET_ROI_NONE
REQUEST_MESSAGE = mavlink.MAV_CMD_REQUEST_MESSAGE

# Those it loads by itself, but for one that draws.
MODULES = (
    "log,signing,wp,rally,fence,ftp,param,relay,tuneopt,arm,mode,calibration,rc,auxopt,misc,cmdlong,battery,terrain,"
    "output,layout"
)

# The side of a tile of terrain, in samples.
TILE = 1201

COMPLAINT = re.compile(
    r"^.*(rejected|error|fail|unknown|usage|unsupported|denied|timed out|no mavlink|traceback).*$", re.I | re.M
)


class MavProxy(Process):
    """The program, with its own home and a terrain that is as high as home everywhere around it."""

    def __init__(self, port, folder):
        self._lay_terrain(pathlib.Path(folder) / ".tilecache/SRTM3")
        here = pathlib.Path(__file__).parent
        program = pathlib.Path(sys.executable).parent / "mavproxy.py"
        arguments = [sys.executable, str(here / "mavproxy_headless.py"), str(program)]
        arguments += [f"--master=udpout:127.0.0.1:{port}", "--state-basedir", folder, "--default-modules", MODULES]
        environment = {**os.environ, "HOME": folder, "PYTHONUNBUFFERED": "1"}
        log = LOGS / "mavproxy-terminal.log"
        super().__init__("MAVProxy", arguments, log, stdin=subprocess.PIPE, cwd=folder, env=environment)

    @staticmethod
    def _lay_terrain(folder):
        """The one tile that is needed, and a list of tiles that is as long as the real one, so that none is fetched."""
        folder.mkdir(parents=True)
        names = {}
        for latitude in range(-60, 60):
            for longitude in range(-180, 180):
                north, east = "NS"[latitude < 0], "EW"[longitude < 0]
                name = f"{north}{abs(latitude):02}{east}{abs(longitude):03}.hgt"
                names[latitude, longitude] = ("", f"{name}.zip")
        (folder / "filelist_python").write_bytes(pickle.dumps(names))
        tile = names[int(HOME[0]), int(HOME[1])][1]
        with zipfile.ZipFile(folder / tile, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr(tile.removesuffix(".zip"), HOME_AMSL.to_bytes(2, "big") * TILE * TILE)

    def say(self, *lines):
        """Types lines, and gives the place in what it prints from where the answers are."""
        self.check()
        place = len(self.printed())
        for line in lines:
            self._child.stdin.write(f"{line}\n".encode())
        self._child.stdin.flush()
        return place

    def printed(self, since=0):
        return self.log.read_text(errors="replace")[since:]

    def wait_printed(self, pattern, since, timeout=3):
        """The first thing printed that fits."""

        def found():
            self.check()
            return re.search(pattern, self.printed(since), re.M)

        return wait_for(lambda: f"{pattern!r} printed; it was {self.printed(since)!r}", found, timeout)

    def expect_no_complaint(self, since):
        lines = [match.group(0) for match in COMPLAINT.finditer(self.printed(since))]
        # Once the manager is its target component, it asks the manager for files, too.
        complaints = [line for line in lines if "FTP: " not in line]
        expect(not complaints, f"it complains: {complaints[:1]}")


def body(steps, rig, wire, proxy):
    camera = rig.camera

    def starts():
        proxy.wait_printed(r"Received \d+ parameters", 0, 20)

    def knows_gimbal():
        """Client checklist E140: "`camera status` shows our vendor and model"."""
        place = proxy.say("module load camera")
        proxy.wait_printed("Loaded module camera", place, 10)
        started = time.monotonic()

        def listed():
            at = proxy.say("camera status")
            proxy.wait_printed("Gimbals:|No MAVLink", at)
            return re.search(r"\* gimbald Simulated v2 \(1:154\)$", proxy.printed(at), re.M)

        wait_for("the gimbal's names in 'camera status'", listed, 5)
        return f"{time.monotonic() - started:.1f} s after loading the module"

    def shows_information():
        def attitude():
            place = proxy.say("camera mount info")
            proxy.wait_printed(r"gimbald Simulated v2 .* firmware=1\.0\.0\.0 pitch=-90\.0\.\.30\.0 yaw=.*\n", place)
            return re.search(r"attitude roll=(\S+) pitch=(\S+) yaw=(\S+)", proxy.printed(place))

        # There is none in the first moment.
        shown = wait_for("the attitude in 'camera mount info'", attitude, 2)
        expect(abs(float(shown.group(2)) - camera.last().pitch) < 1, f"{shown.group(0)} of {camera.last()}")

    def steers(command, **wanted):
        place = proxy.say(command)
        camera.wait_at(**wanted)
        proxy.expect_no_complaint(place)

    def sets_angles():
        # At first with the gimbal id 0 that it comes with.
        proxy.say("camera set manager_component 191")
        steers("camera mount angle -20 10", pitch=-20, yaw_vehicle=10)
        proxy.say("camera set manager_gimbal_id 154")
        steers("camera mount angle -40 -30", pitch=-40, yaw_vehicle=-30)
        steers("camera mount angle -40 -30 body", pitch=-40, yaw_vehicle=-30)
        steers("camera mount angle 0 0", pitch=0, yaw_vehicle=0)

    def sets_angles_from_north():
        for yaw in (90, -135):
            steers(f"camera mount angle -10 {yaw} earth", pitch=-10, yaw_north=yaw)
        rate = camera.rate("yaw_vehicle")
        expect(abs(rate + TURN_RATE_DPS) < 1, f"turns at {rate:.2f} °/s against the vehicle")

    def turns():
        steers("camera mount angle 25 0", pitch=25, yaw_vehicle=0)
        place = proxy.say("camera mount rate -8 5")
        # It is said once, as a command, and lasts longer than the 2 s of a message.
        wait_for("a pitch of 5°", lambda: camera.last().pitch < 5, 5)
        pitch_rate, yaw_rate = camera.rates(["pitch", "yaw_vehicle"], 1.5)
        expect(abs(pitch_rate + 8) < 1, f"pitch turns at {pitch_rate:.2f} °/s")
        expect(abs(yaw_rate - 5) < 1, f"yaw turns at {yaw_rate:.2f} °/s")
        proxy.say("camera mount rate 0 0")
        camera.wait_still("pitch", 2)
        camera.wait_still("yaw_vehicle", 2)
        proxy.expect_no_complaint(place)

    def turns_from_north():
        steers("camera mount angle 0 0 earth", pitch=0, yaw_north=0)
        place = proxy.say("camera mount rate 0 10 earth")
        wait_for("a yaw of 5°", lambda: camera.last().yaw_north > 5, 3)
        rate = camera.rate("yaw_north")
        expect(abs(rate - 10) < 1.5, f"yaw turns at {rate:.2f} °/s over ground")
        proxy.say("camera mount rate 0 0")
        proxy.expect_no_complaint(place)

    def goes_home():
        steers("camera mount angle -30 40", pitch=-30, yaw_vehicle=40)
        for command, mode in (("center", "neutral"), ("neutral", "neutral"), ("retract", "retract")):
            place = proxy.say(f"camera mount {command}")
            wait_for(f"{mode} on the page", lambda: rig.gimbal()["setpoint"]["mode"] == mode, 2)
            camera.wait_at(pitch=0, yaw_vehicle=0)
            wait_for(f"the gimbal's flag {mode}", lambda: mode in rig.gimbal()["flags"], 2)
            steers("camera mount angle -15 20", pitch=-15, yaw_vehicle=20)
            expect(mode not in rig.gimbal()["flags"], f"the flag {mode} stays")
            proxy.expect_no_complaint(place)

    def points():
        # It wants to know for which camera; one that nobody has heard of will do.
        place = proxy.say("camera select 100", "click {} {}".format(*HOME), "camera roi")
        proxy.wait_printed(rf"Camera 1:100 ROI 47\.3977420 8\.5455940 {HOME_AMSL}\.0m AMSL", place)
        camera.wait_at(pitch=PITCH_TO_HOME, yaw_vehicle=90, within=3)
        roi = rig.gimbal()["roi"]
        expect(roi and roi["altitude_amsl_m"] == HOME_AMSL, f"the page shows {roi}")
        proxy.expect_no_complaint(place)

    def ends_roi():
        place = proxy.say("camera roi clear")
        wait_for("no ROI on the page", lambda: rig.gimbal()["roi"] is None, 2)
        proxy.say("camera roi all")
        wait_for("a ROI on the page", lambda: rig.gimbal()["roi"], 2)
        # A setpoint ends it too: this client clears it before.
        steers("camera for 1:100 mount angle 0 0", pitch=0, yaw_vehicle=0)
        expect(rig.gimbal()["roi"] is None, "the page still shows a ROI")
        proxy.expect_no_complaint(place)

    def refused(other):
        expect(other.configure(other.ids) == ACCEPTED, "the other could not take control")
        expect(other.pitchyaw(-20, 15) == ACCEPTED, "the other could not steer")
        camera.wait_at(pitch=-20, yaw_vehicle=15)
        before = rig.refusals(IDS)
        lines = {
            "camera mount angle 10 -40": "DO_GIMBAL_MANAGER_PITCHYAW",
            "camera mount angle 10 -40 earth": "DO_GIMBAL_MANAGER_PITCHYAW",
            "camera mount rate 20 20": "DO_GIMBAL_MANAGER_PITCHYAW",
            "camera mount center": "DO_GIMBAL_MANAGER_PITCHYAW",
            "camera mount retract": "DO_GIMBAL_MANAGER_PITCHYAW",
            "camera roi": "DO_SET_ROI_LOCATION",
        }
        for line, command in lines.items():
            place = proxy.say(line)
            proxy.wait_printed(rf"Camera command MAV_CMD_{command} rejected by 1:191 \(MAV_RESULT_DENIED\)", place)
        camera.expect_still(1.5, pitch=-20, yaw_vehicle=15)
        counted = rig.refusals(IDS) - before
        # It takes back the ROI that was refused.
        expect(counted == len(lines) + 1, f"the page counts {counted} refusals of {len(lines)} and one of its own")
        rig.wait_owners("{}/{}".format(*other.ids))

    def steers_again(other):
        expect(other.configure((-3, -3)) == ACCEPTED, "the other could not release control")
        rig.wait_owners(None)
        steers("camera mount angle -12 6", pitch=-12, yaw_vehicle=6)
        expect(rig.owners() == (None, None), f"the page says {rig.owners()}")

    def loads_gimbal_module():
        place = proxy.say("module load gimbal", "set target_component 191")
        proxy.wait_printed("Loaded module gimbal", place, 5)
        proxy.wait_printed("target_component 191", place)

    def gimbal_module_turns():
        """Client checklist E101: "282 at 1 Hz, flags 0, id 0, q NaN, ωx 0: turns without pauses"."""
        steers("camera mount angle 20 0", pitch=20, yaw_vehicle=0)
        place = proxy.say("gimbal rate 0 -7 5")
        wait_for("a pitch of 15°", lambda: camera.last().pitch < 15, 5)
        seen = camera.watch(4.2)
        begin = seen[0].clock
        for axis, rate in (("pitch", -7), ("yaw_vehicle", 5)):
            for second in range(4):
                turned = slope([one for one in seen if second <= one.clock - begin <= second + 1], axis)
                expect(abs(turned - rate) < 1, f"{axis} turns at {turned:.2f} °/s in second {second}")
        proxy.say("gimbal rate 0 0 0")
        camera.wait_still("pitch", 3)
        proxy.expect_no_complaint(place)

    def gimbal_module_points():
        """Client checklist E126 and E127: 204 and 205 addressed to the manager."""
        steers("gimbal angle 0 -30 25", pitch=-30, yaw_vehicle=25)
        for mode in ("neutral", "retract"):
            place = proxy.say(f"gimbal mode {mode}")
            wait_for(f"the gimbal's flag {mode}", lambda: mode in rig.gimbal()["flags"], 2)
            proxy.wait_printed("Got COMMAND_ACK: DO_MOUNT_CONFIGURE: ACCEPTED", place)
            place = proxy.say("gimbal mode mavlink")
            proxy.wait_printed("Got COMMAND_ACK: DO_MOUNT_CONFIGURE: ACCEPTED", place)
            steers("gimbal angle 0 -20 -15", pitch=-20, yaw_vehicle=-15)
        # Degrees of latitude and longitude times 1e7, as floats.
        steers("gimbal roi {} {} 0".format(*HOME), pitch=PITCH_TO_HOME, yaw_vehicle=90, within=3)
        roi = rig.gimbal()["roi"]
        expect(roi and abs(roi["altitude_amsl_m"] - HOME_AMSL) < 1, f"the page shows {roi}")
        place = proxy.say("gimbal mode rc")
        proxy.wait_printed("Got COMMAND_ACK: DO_MOUNT_CONFIGURE: UNSUPPORTED", place)
        steers("gimbal angle 0 0 0", pitch=0, yaw_vehicle=0)

    def asked():
        """Client checklist E21: "512/p1=283 … to 171–175 while they are nobody: total silence"; E29 likewise."""
        requests = [frame for frame in commands(wire.peer_said()) if frame.message.command == REQUEST_MESSAGE]
        asked = {frame.target[1] for frame in requests if frame.message.param1 == 283}
        expect(asked == {154, *range(171, 176)}, f"it asked {asked}")
        # The ground station is the other who had control.
        heard = {frame.source for frame in wire.daemon_said()}
        expect(heard == {(1, 1), (1, 191), (1, 154), (254, 190)}, f"it heard {heard}")

    def spoke():
        said = {frame.message.command for frame in commands(wire.peer_said()) if frame.target == (1, 191)}
        expect({PITCHYAW, ROI_LOCATION, ROI_NONE} <= said, f"it spoke past the tap: {said}")
        expect(mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE not in said, "it configures")
        return "commands {}".format(", ".join(map(str, sorted(said))))

    steps.run("sees the vehicle", starts, essential=True)
    steps.run("shows the gimbal's vendor and model", knows_gimbal, essential=True)
    steps.run("shows its limits and attitude", shows_information)
    steps.run("sets angles", sets_angles)
    steps.run("sets angles from North", sets_angles_from_north)
    steps.run("turns at a rate and stops", turns)
    steps.run("turns at a rate over ground", turns_from_north)
    steps.run("centers, goes to neutral and retracts", goes_home)
    steps.run("points at a click on the map", points)
    steps.run("ends pointing", ends_roi)
    with GroundStation(rig.ground_port, 254, device=rig.kind.device) as other:
        steps.run("says that it is refused while another has control", lambda: refused(other))
        steps.run("steers again after the other's release", lambda: steers_again(other))
    steps.run("loads its older gimbal module", loads_gimbal_module)
    steps.run("turns without pauses at the older module's rate", gimbal_module_turns)
    steps.run("points by the older module", gimbal_module_points)
    steps.run("asked six components, and one answered", asked)
    steps.run("never took control", spoke)
    steps.run("the daemon is well", rig.daemon.check)


def main():
    steps = Steps(f"MAVProxy {version('MAVProxy')}")

    def run():
        with Rig("mavproxy", autopilot="ardupilot") as rig, tempfile.TemporaryDirectory(prefix="mavproxy-") as folder:
            wire = rig.ground_wire()
            proxy = MavProxy(wire.port, folder)
            try:
                body(steps, rig, wire, proxy)
            finally:
                proxy.kill()

    steps.script(run)


main()
