"""What every MAVSDK can say to a gimbal, said and judged: the steps of `mavsdk_1.py`, `mavsdk_3.py` and `mavsdk_4.py`.

Where the camera looks is judged by the gimbal's own word on its cable, who holds it by the status page.
"""

from dialect import mavlink
from frames import commands
from ground import GroundStation
from rig import HOME, PITCH_TO_HOME, TURN_RATE_DPS
from steps import angle_between, expect, wait_for

ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
NOBODY = (0, 0)

# The point of MAVSDK's own example, whose altitude it means above the sea and sends as one above home.
EXAMPLE_POINT = (47.39743832, 8.5463316, 488)

# The commands of the older protocol, DO_MOUNT_CONFIGURE and DO_MOUNT_CONTROL.
OLD_COMMANDS = {204, 205}


class Client:
    """What the steps need of a MAVSDK."""

    ids = (245, 190)
    # Whether angles and rates can be sent as a command, which is answered, and gimbals chosen by number.
    has_commands = True

    # Filled by the client's attitude stream.
    attitudes = None

    def take(self, everybody=False):
        raise NotImplementedError

    def release(self, everybody=False):
        raise NotImplementedError

    def angles(self, pitch, yaw, lock=False, once=True, roll=0, everybody=False):
        raise NotImplementedError

    def rates(self, pitch, yaw, lock=False, once=True, everybody=False):
        raise NotImplementedError

    def roi(self, latitude, longitude, altitude, everybody=False):
        raise NotImplementedError

    def owner(self):
        """PRIMARY, SECONDARY or NONE, as the client sees its own control, and the two pairs that have it."""
        raise NotImplementedError

    def expect_refused(self, call):
        """Fails unless the call ends with the gimbal's refusal."""
        raise NotImplementedError

    def wait_owner(self, mode, primary, secondary):
        wait_for(
            lambda: f"{mode} control with {primary} and {secondary}; the client sees {self.owner()}",
            lambda: self.owner() == (mode, primary, secondary),
            3,
        )


def demands(wire):
    """What the client has sent for a gimbal, but for questions."""
    frames = wire.peer_said()
    asking = {mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES}
    ordered = [frame for frame in commands(frames) if frame.message.command not in asking]
    return ordered + [frame for frame in frames if frame.name.startswith("GIMBAL_")]


def name(ids):
    """The form of the page."""
    return "{}/{}".format(*ids)


class Vocabulary:
    """All the steps with one client on one rig; `wire` is the client's path to the daemon."""

    def __init__(self, steps, rig, client, wire):
        self.steps, self.rig, self.client, self.wire = steps, rig, client, wire
        self.camera = rig.camera
        # As a command, then as a stream of messages.
        self.ways = [("once", True), ("as a stream", False)] if client.has_commands else [("as a stream", False)]

    def run(self):
        """Everything."""
        run = self.steps.run
        run("sees the attitude", self.attitude_comes)
        run("takes control", self.takes)
        for how, once in self.ways:
            run(f"sets angles {how}", lambda: self.sets_angles(once))
        run("sees where the camera looks", self.sees_truth)
        if self.client.has_commands:
            run("rolls", self.rolls)
        run("follows the vehicle", self.follows)
        run("locks yaw to North, East, South and West", self.locks)
        run("sees a locked camera", self.sees_truth)
        for how, once in self.ways:
            run(f"turns at a rate {how}, and stops", lambda: self.turns(once))
        run("a streamed rate ends by itself", self.streamed_rate_ends)
        run("turns at a rate while locked", self.turns_locked)
        run("points at a location", self.points)
        run("takes the point of its own example", self.points_as_example)
        if self.client.has_commands:
            run("addresses every gimbal with id 0", self.addresses_everybody)
        run("releases control", self.releases)
        with GroundStation(self.rig.ground_port, 254, device=self.rig.kind.device) as other:
            run("sees that another has control", lambda: self.another_takes(other), essential=True)
            run("is refused while another has control", lambda: self.is_refused(other))
            run("takes control over, and the other is refused", lambda: self.takes_over(other))
        run("steers what nobody holds", self.steers_unclaimed)
        run("never spoke the older protocol", self.spoke)
        run("was never told to wait", self.never_in_progress)
        run("the daemon is well", self.rig.daemon.check)

    def run_in_short(self):
        """What may differ with another autopilot."""
        run = self.steps.run
        run("takes control", self.takes)
        for how, once in self.ways:
            run(f"sets angles {how}", lambda: self.sets_angles(once))
        run("sees where the camera looks", self.sees_truth)
        run("locks yaw", lambda: self.locks([90]))
        for how, once in self.ways:
            run(f"turns at a rate {how}, and stops", lambda: self.turns(once))
        run("points at a location", self.points)
        run("releases control", self.releases)
        run("never spoke the older protocol", self.spoke)
        run("the daemon is well", self.rig.daemon.check)

    def attitude_comes(self):
        seen = self.client.attitudes.watch(2.0)
        expect(len(seen) >= 8, f"{len(seen)} attitudes in 2 s")
        return f"{len(seen) / 2:.0f} a second"

    def takes(self):
        # It always takes both.
        self.client.take()
        ids = self.client.ids
        self.rig.wait_owners(name(ids), name(ids))
        self.client.wait_owner("PRIMARY", ids, ids)

    def sets_angles(self, once):
        for pitch, yaw in [(-30, 20), (-60, -45), (10, 0)]:
            self.client.angles(pitch, yaw, once=once)
            self.camera.wait_at(pitch=pitch, yaw_vehicle=yaw)

    def sees_truth(self):
        axes = ("roll", "pitch", "yaw_vehicle", "yaw_north")
        shown = self.client.attitudes.watch(0.3)[-1]
        known = [axis for axis in axes if getattr(shown, axis) is not None]

        def apart():
            shown, true = self.client.attitudes.last(), self.camera.last()
            # The vehicle turns 2° between two of its own attitudes, by which the library converts one yaw to the other.
            return [a for a in known if not angle_between(getattr(shown, a), getattr(true, a)) < 4]

        wait_for(
            lambda: f"the gimbal's {apart()}: {self.client.attitudes.last()} of {self.camera.last()}",
            lambda: not apart(),
            3,
        )
        return " and ".join(known)

    def rolls(self):
        # A roll is possible as a stream only.
        self.client.angles(0, 0, roll=10, once=False)
        self.camera.wait_at(roll=10, pitch=0, yaw_vehicle=0)
        self.client.angles(0, 0, once=False)
        self.camera.wait_at(roll=0, pitch=0, yaw_vehicle=0)

    def follows(self):
        self.client.angles(0, 0)
        self.camera.wait_at(pitch=0, yaw_vehicle=0)
        rate = self.camera.rate("yaw_north")
        expect(abs(rate - TURN_RATE_DPS) < 1, f"turns at {rate:.2f} °/s over ground, the vehicle at {TURN_RATE_DPS}")

    def locks(self, directions=(0, 90, 180, -90)):
        for yaw in directions:
            self.client.angles(-5, yaw, lock=True)
            self.camera.wait_at(pitch=-5, yaw_north=yaw, within=self.rig.kind.within_north)
        rate = self.camera.rate("yaw_vehicle")
        expect(abs(rate + TURN_RATE_DPS) < 1, f"turns at {rate:.2f} °/s against the vehicle")
        self.camera.wait_at(pitch=-5, yaw_north=directions[-1], within=self.rig.kind.within_north)

    def turns(self, once):
        self.client.angles(20, 0, once=once)
        self.camera.wait_at(pitch=20, yaw_vehicle=0)
        self.client.rates(-10, 5, once=once)
        # Both at a time: a rate in a message holds for [control] rate_timeout_s, 2 s.
        pitch_rate, yaw_rate = self.camera.rates(["pitch", "yaw_vehicle"], 1.5)
        self.client.rates(0, 0, once=once)
        expect(abs(pitch_rate + 10) < 1.5, f"pitch turns at {pitch_rate:.2f} °/s")
        expect(abs(yaw_rate - 5) < 1.5, f"yaw turns at {yaw_rate:.2f} °/s")
        self.camera.wait_still("pitch", 2)
        self.camera.wait_still("yaw_vehicle", 2)

    def streamed_rate_ends(self):
        self.client.rates(0, 15, once=False)
        rate = self.camera.rate("yaw_vehicle", 1.0)
        expect(abs(rate - 15) < 3, f"yaw turns at {rate:.2f} °/s")
        # [control] rate_timeout_s is 2.
        self.camera.wait_still("yaw_vehicle", 4)

    def turns_locked(self):
        """Client checklist E108: "Rate while locked (bit 16) is about north"."""
        self.client.angles(0, 0, lock=True)
        self.camera.wait_at(pitch=0, yaw_north=0, within=self.rig.kind.within_north)
        self.client.rates(0, 10, lock=True)
        rate = self.camera.rate("yaw_north", 1.5)
        self.client.rates(0, 0, lock=True)
        expect(abs(rate - 10) < 2, f"yaw turns at {rate:.2f} °/s over ground")

    def points(self):
        self.client.roi(*HOME, 0)
        self.camera.wait_at(pitch=PITCH_TO_HOME, yaw_vehicle=90, within=3)
        roi = self.rig.gimbal()["roi"]
        expect(roi is not None, "the page shows no ROI")
        self.client.angles(0, 0)
        self.camera.wait_at(pitch=0, yaw_vehicle=0)
        expect(self.rig.gimbal()["roi"] is None, "the page still shows a ROI")

    def points_as_example(self):
        self.client.roi(*EXAMPLE_POINT)
        roi = wait_for("a ROI on the page", lambda: self.rig.gimbal()["roi"], 1)
        expect(abs(roi["latitude_deg"] - EXAMPLE_POINT[0]) < 1e-6, f"the page shows {roi}")
        expect(abs(roi["longitude_deg"] - EXAMPLE_POINT[1]) < 1e-6, f"the page shows {roi}")

    def addresses_everybody(self):
        client = self.client
        client.release(everybody=True)
        self.rig.wait_owners(None)
        client.take(everybody=True)
        self.rig.wait_owners(name(client.ids), name(client.ids))
        for how, once in self.ways:
            for pitch, yaw in [(-8, 8), (-16, -16)]:
                client.angles(pitch, yaw, once=once, everybody=True)
                self.camera.wait_at(pitch=pitch, yaw_vehicle=yaw)
            client.rates(10, 0, once=once, everybody=True)
            rate = self.camera.rate("pitch", 1.0)
            client.rates(0, 0, once=once, everybody=True)
            expect(abs(rate - 10) < 2, f"pitch turns at {rate:.2f} °/s {how}")
        client.roi(*HOME, 0, everybody=True)
        self.camera.wait_at(pitch=PITCH_TO_HOME, yaw_vehicle=90, within=3)

    def releases(self):
        self.client.release()
        self.rig.wait_owners(None)
        self.client.wait_owner("NONE", NOBODY, NOBODY)

    def another_takes(self, other):
        expect(other.configure(other.ids) == ACCEPTED, "the other could not take control")
        expect(other.pitchyaw(-20, 15) == ACCEPTED, "the other could not steer")
        self.camera.wait_at(pitch=-20, yaw_vehicle=15)
        self.client.wait_owner("NONE", other.ids, NOBODY)

    def is_refused(self, other):
        """Client checklist E138: "setpoints are refused while another client holds primary control, and the owner is
        visible"."""
        client = self.client
        before, count = self.rig.refusals(client.ids), 0
        for once in (once for _, once in self.ways):
            calls = [
                lambda: client.angles(10, -40, once=once),
                lambda: client.angles(10, -40, lock=True, once=once),
                lambda: client.rates(20, 20, once=once),
            ]
            for call in calls:
                # There is no answer to a message.
                client.expect_refused(call) if once else call()
                count += 1
        client.expect_refused(lambda: client.roi(*HOME, 0))
        count += 1
        # He may always release what he does not have.
        client.release()
        self.camera.expect_still(1.5, pitch=-20, yaw_vehicle=15)
        self.rig.wait_owners(name(other.ids))
        counted = self.rig.refusals(client.ids) - before
        expect(counted == count, f"the page counts {counted} refusals, there were {count}")
        return f"{count} times"

    def takes_over(self, other):
        self.client.take()
        ids = self.client.ids
        self.client.wait_owner("PRIMARY", ids, ids)
        other.wait_owner(ids, ids)
        expect(other.pitchyaw(30, 30) == DENIED, "the other was not refused")
        self.client.angles(5, -5)
        self.camera.wait_at(pitch=5, yaw_vehicle=-5)
        self.client.release()
        self.client.wait_owner("NONE", NOBODY, NOBODY)

    def steers_unclaimed(self):
        self.client.angles(-12, 6)
        self.camera.wait_at(pitch=-12, yaw_vehicle=6)
        expect(self.rig.owners() == (None, None), f"the page says {self.rig.owners()}")

    def spoke(self):
        """Client checklist E129: "no 204/205 seen in a run"."""
        said = {frame.message.command for frame in commands(self.wire.peer_said())}
        expect(mavlink.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE in said, f"it spoke past the tap: {said}")
        expect(not said & OLD_COMMANDS, f"it sent {said & OLD_COMMANDS}")
        return "commands {}".format(", ".join(map(str, sorted(said))))

    def never_in_progress(self):
        """Client checklist E121: "No answer of ours ever has result IN_PROGRESS"."""
        answers = [
            frame.message
            for frame in self.wire.daemon_said()
            if frame.name == "COMMAND_ACK" and frame.source == (1, 191)
        ]
        expect(len(answers) > 3, f"only {len(answers)} answers")
        waiting = [ack for ack in answers if ack.result == mavlink.MAV_RESULT_IN_PROGRESS]
        expect(not waiting, f"in progress: {waiting[:1]}")
        return f"{len(answers)} answers"
