"""QGroundControl, release by release, as `qgroundcontrol_client.py` plays it.

Without `snoop_autopilot`, and with it: then what it says to the autopilot is obeyed, and never answered.
"""

import concurrent.futures
import time

import gimbals
from attitudes import slope
from dialect import mavlink
from frames import commands
from ground import GroundStation
from qgroundcontrol_client import (
    CONFIGURE,
    EARLY_2026,
    FIRST_4_4,
    INFORMATION,
    LINE_2024,
    NEWEST,
    PITCHYAW,
    REQUEST_MESSAGE,
    QGroundControl,
    Qt5QGroundControl,
)
from rig import HOME, HOME_AMSL, PITCH_TO_HOME, TURN_RATE_DPS, Rig
from stalls import stalled
from steps import Steps, angle_between, expect, wait_for

ACCEPTED, DENIED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
MANAGER, AUTOPILOT = (1, 191), (1, 1)
CAN_RETRACT, CAN_LOCK = 1, 1024
OWN = "{}/{}".format(*QGroundControl.ids)

SNOOP = "[control]\nsnoop_autopilot = true\n"
EXCLUSIVE = '[[gimbal]]\nname = "camera"\nlink = "gimbal"\ntakeover = "exclusive"\n'


class Operator:
    """One release in front of one rig, and what its operator does."""

    def __init__(self, steps, rig, client, wire):
        self.steps, self.rig, self.client, self.wire = steps, rig, client, wire
        self.camera = rig.camera

    def step(self, name, step, **how):
        self.steps.run(f"{self.client.generation.name}: {name}", step, **how)

    def center(self):
        """Ahead, with the answers in, so that what comes next is not thrown away."""
        self.client.center()
        self.camera.wait_at(pitch=0, yaw_vehicle=0)
        wait_for("the answers", lambda: not self.client.is_waiting(), 1)

    def appears(self):
        client = self.client
        wait_for("the gimbal in the toolbar", lambda: client.check() or client.active, 20)
        took = client.found_at - client.gate_at
        # It asks at a heartbeat, of which there is one a second.
        expect(took < 2.5, f"{took:.2f} s after it began to look for gimbals")
        expect(client.listed == [self.rig.kind.ids], f"it lists {client.listed}")
        can = client.active.information.cap_flags
        expect(can & CAN_RETRACT and can & CAN_LOCK, f"a button is missing: {can:#x}")
        asked = [
            frame
            for frame in commands(self.wire.peer_said())
            if frame.target == MANAGER and (frame.message.command, frame.message.param1) == (REQUEST_MESSAGE, INFORMATION)
        ]
        # As a component that beats; and once more as the manager of a gimbal, if it has heard of that at the same time, or
        # as it beat again while another component's answer was waited for.
        expect(1 <= len(asked) <= 2, f"it had to ask {len(asked)} times")

        def answers():
            frames = self.wire.daemon_said()
            return [frame for frame in frames if (frame.name, frame.source) == ("GIMBAL_MANAGER_INFORMATION", MANAGER)]

        wait_for("the answer to each question", lambda: len(answers()) >= len(asked), 1)
        return f"{took:.2f} s after it began to look for gimbals"

    def acquires_and_releases(self):
        client, active = self.client, self.client.active
        expect(not active.have_control and not active.others_have_control, "somebody has control")
        client.acquire()
        wait_for("control", lambda: active.have_control, 0.5)
        self.rig.wait_owners(OWN)
        client.release()
        wait_for("no control", lambda: not active.have_control and not active.others_have_control, 0.5)
        self.rig.wait_owners(None)
        self.expect_no_error()

    def centers(self):
        """Client checklist E59: "1001 immediately followed by 1000 …: both ACCEPTED, in this order, gimbal moves"."""
        client = self.client
        expect(not client.active.have_control, "it has control already")
        before = time.monotonic()
        client.center()
        self.camera.wait_at(pitch=0, yaw_vehicle=0)
        wait_for("control", lambda: client.active.have_control, 0.5)
        self.rig.wait_owners(OWN)
        answers = [
            (frame.message.command, frame.message.result)
            for frame in self.wire.daemon_said(before)
            if frame.name == "COMMAND_ACK" and frame.source == MANAGER
        ]
        expect(answers == [(CONFIGURE, ACCEPTED), (PITCHYAW, ACCEPTED)], f"it was answered {answers}")
        self.expect_no_error()

    def tilts(self):
        self.client.tilt_90()
        self.camera.wait_at(pitch=-90)
        self.client.center()
        self.camera.wait_at(pitch=0, yaw_vehicle=0)
        self.expect_no_error()

    def clicks(self):
        for pan, tilt in ((0.5, -0.75), (-1, 0.5)):
            pitch, yaw = self.client.click(pan, tilt)
            self.camera.wait_at(pitch=pitch, yaw_vehicle=yaw)

    def shows_attitude(self):
        active = self.client.active

        def apart():
            true = self.camera.last()
            # It shows what was true one message of the gimbal and one of the vehicle before, in whole degrees.
            shown = {"pitch": active.pitch, "yaw_vehicle": active.body_yaw, "yaw_north": active.absolute_yaw}
            return {axis: angle for axis, angle in shown.items() if angle_between(angle, getattr(true, axis)) > 4}

        wait_for(lambda: f"the gimbal's angles, not {apart()}: {self.camera.last()}", lambda: not apart(), 3)

    def locks(self):
        """Client checklist E48: "The YAW_LOCK bit in 285 is set within 500 ms of a lock command and cleared …"."""
        client, active = self.client, self.client.active
        north = self.camera.last().yaw_north
        client.set_yaw_lock(True)
        wait_for("the label 'Yaw locked'", lambda: active.label == "Yaw locked", 0.5)
        # The vehicle turns while it reckons with what it saw last.
        self.camera.expect_still(1.5, yaw_north=north, within=8)
        rate = self.camera.rate("yaw_vehicle")
        expect(abs(rate + TURN_RATE_DPS) < 1, f"turns at {rate:.2f} °/s against the vehicle")
        pitch, yaw = client.click(0.5, -0.25)
        self.camera.wait_at(pitch=pitch, yaw_north=yaw, within=self.rig.kind.within_north)
        client.set_yaw_lock(False)
        wait_for("the label 'Yaw follow'", lambda: active.label == "Yaw follow", 0.5)
        rate = self.camera.rate("yaw_north")
        expect(abs(rate - TURN_RATE_DPS) < 1, f"turns at {rate:.2f} °/s over ground")
        self.expect_no_error()

    def retract_and_center(self):
        client, active = self.client, self.client.active
        client.tilt_90()
        self.camera.wait_at(pitch=-90)
        client.retract()
        kind = self.rig.kind
        if kind.tells_retract:
            wait_for("the label 'Retracted'", lambda: active.label == "Retracted", 1)
        if kind.stowed:
            pitch, yaw = kind.stowed
            self.camera.wait_at(pitch=pitch, yaw_vehicle=yaw)
        expect(active.label == ("Retracted" if kind.tells_retract else "Yaw follow"), f"it is labelled {active.label}")
        expect("retract" in self.rig.gimbal()["flags"], "the page does not say that it is retracted")
        self.center()
        wait_for("the label 'Yaw follow'", lambda: active.label == "Yaw follow", 1)

    def retracts(self):
        self.retract_and_center()
        self.expect_no_error()

    def expect_smooth(self, axis, rate):
        """Turns evenly over 2 s, in which it is told the rate several times."""
        seen = self.camera.watch(3)
        # The first moments go into getting there.
        start = getattr(seen[0], axis)
        begun = [one.clock for one in seen if angle_between(getattr(one, axis), start) > abs(rate) * 0.05]
        expect(begun and begun[0] < seen[-1].clock - 2.2, f"{axis} does not turn within {3 - 2.2:.1f} s")
        begin = begun[0] + 0.15
        spans = [(begin + half * 0.5, begin + (half + 1) * 0.5) for half in range(4)]
        parts = [[one for one in seen if start <= one.clock <= end] for start, end in spans]
        # Where the machine stalled again and again, all of it has to do.
        even = [part for part in parts if not stalled(part[0].time - 0.2, part[-1].time)]
        for part in even or [sum(parts, [])]:
            turned = slope(part, axis)
            # A pause of 0.1 s is as good as none.
            expect(abs(turned - rate) < 4, f"{axis} turns at {turned:.2f} °/s from {part[0].clock - begin:.1f} s on")

    def turns(self):
        """Client checklist E99, E100 and E103: smooth at the repeats; "one zero rate stops within 200 ms"."""
        client = self.client
        self.center()
        client.press(yaw=1)
        self.expect_smooth("yaw_vehicle", 20)
        client.let_go()
        at = self.camera.last()
        self.camera.wait_still("yaw_vehicle", 2)
        beyond = self.camera.last().yaw_vehicle - at.yaw_vehicle
        # What was seen last is up to 100 ms old, and the ramp to zero takes 200 ms.
        expect(beyond < 20 * 0.35, f"it turned {beyond:.1f}° more")
        client.press(pitch=-1)
        self.expect_smooth("pitch", -20)
        client.let_go()
        self.camera.wait_still("pitch", 2)

    def turns_locked(self):
        client, active = self.client, self.client.active
        client.set_yaw_lock(True)
        wait_for("the label 'Yaw locked'", lambda: active.label == "Yaw locked", 1)
        client.press(yaw=-1)
        self.expect_smooth("yaw_north", -20)
        expect(active.label == "Yaw locked", f"it is {active.label}")
        client.let_go()
        self.camera.wait_still("yaw_north", 2)

    def rate_ends(self):
        """Client checklist E102: "Stream ends without a zero: rates stop within the dead-man time (≤ 3 s)"."""
        client = self.client
        self.center()
        client.press(pitch=-1)
        # Until it was told twice at least: a command that is said once is no stream.
        wait_for("it turns", lambda: self.camera.last().pitch < -15, 2)
        client.forget_rate()
        self.camera.wait_still("pitch", 3)

    def gimbal_rate_ends(self):
        """What it sends to stop it, after half a second, is another kind of message in one release than in the next."""
        client = self.client
        self.center()
        client.gimbal_rate(-10, 0)
        wait_for("it turns", lambda: self.camera.last().pitch < -2, 1)
        self.camera.wait_still("pitch", 2)
        # 10 °/s for 0.5 s, and a ramp at either end.
        pitch = self.camera.last().pitch
        expect(-9 < pitch < -3, f"it went to {pitch:.1f}°")

    def drags(self):
        """Client checklist E88: "1000 ten times a second …: 100 ACKs, each < 100 ms after its command"."""
        client = self.client
        self.center()
        before = len(client.answer_times)
        client.start_drag(1, -0.5)
        self.camera.watch(2.0)
        client.stop_drag()
        self.camera.wait_still("yaw_vehicle", 2)
        times = client.answer_times[before:]
        expect(len(times) >= 18, f"only {len(times)} answers in 2 s")
        at = self.camera.last()
        expect(at.yaw_vehicle > 10 and at.pitch < -5, f"it was dragged to {at}")
        self.expect_nothing_lost()
        return f"{len(times)} commands, the slowest answer after {max(times) * 1000:.0f} ms"

    def another_has_control(self, other):
        client, active = self.client, self.client.active
        self.center()
        # In the moment in which another takes control it does not know, and shows that it was refused.
        with client.looking_away():
            expect(other.configure(other.ids) == ACCEPTED, "the other could not take control")
            expect(other.pitchyaw(-20, 15) == ACCEPTED, "the other could not steer")
            client.center()
        wait_for("an error", lambda: client.errors, 1)
        expect(client.errors == [(PITCHYAW, DENIED)], f"it shows {client.errors}")
        client.errors.clear()
        wait_for("others in control", lambda: active.others_have_control and not active.have_control, 0.5)
        # From then on it asks the operator, and sends nothing.
        popups, said = client.popups, self.sent()
        client.click(0.5, 0.5)
        client.tilt_90()
        client.press(yaw=1)
        client.set_yaw_lock(True)
        self.camera.wait_at(pitch=-20, yaw_vehicle=15)
        self.camera.expect_still(1.0, pitch=-20, yaw_vehicle=15)
        expect(client.popups == popups + 4, f"it asked the operator {client.popups - popups} times")
        expect(self.sent() == said, f"it sent {self.sent() - said} of them")
        client.forget_rate()

    def takes_over(self, other):
        client, active = self.client, self.client.active
        client.acquire()
        wait_for("control", lambda: active.have_control and not active.others_have_control, 0.5)
        other.wait_owner(client.ids)
        pitch, yaw = client.click(0.25, 0.25)
        self.camera.wait_at(pitch=pitch, yaw_vehicle=yaw)
        expect(other.pitchyaw(30, 30) == DENIED, "the other was not refused")
        client.release()
        wait_for("no control", lambda: not active.have_control, 0.5)
        self.expect_no_error()

    def sent(self):
        """How often it has steered or configured."""
        frames = self.wire.peer_said()
        ordered = [frame for frame in commands(frames) if frame.message.command in (PITCHYAW, CONFIGURE)]
        return len(ordered) + len([frame for frame in frames if frame.name == "GIMBAL_MANAGER_SET_ATTITUDE"])

    def expect_no_error(self):
        expect(not self.client.errors, f"it shows {self.client.errors}")

    def expect_nothing_lost(self):
        """Of what the operator did, and the manager was sent."""
        client = self.client
        client.check()
        thrown_away = [
            one
            for one in client.thrown_away
            # It asks for information at a heartbeat and again at a status; the answer to the first is one to both.
            if one.key[1] != REQUEST_MESSAGE and not stalled(one.since, one.until)
        ]
        expect(not thrown_away, f"it threw away {thrown_away}")
        unanswered = [key for key in client.unanswered if key[0] == MANAGER[1]]
        expect(not unanswered, f"without an answer: {unanswered}")

    def ends(self):
        self.expect_nothing_lost()
        self.expect_no_error()
        slowest = max(self.client.answer_times)
        expect(slowest < 0.5, f"an answer took {slowest:.2f} s")
        expect(self.client.listed == [self.rig.kind.ids], f"it lists {self.client.listed}")
        return f"slowest of {len(self.client.answer_times)} answers: {slowest * 1000:.0f} ms"

    # --- what goes to the autopilot ----------------------------------------------------------------------------

    def own_answers(self, since):
        """What the manager has answered to this client."""
        frames = self.wire.daemon_said(since)
        return [frame.message for frame in frames if frame.name == "COMMAND_ACK" and frame.source == MANAGER]

    def points_by_autopilot(self, with_long):
        """Client checklist E118: "With the "listen in" option on: obeyed, still no ACK"."""
        client, since = self.client, time.monotonic()
        client.roi(*HOME, HOME_AMSL, with_long=with_long)
        roi = wait_for("a ROI on the page", lambda: self.rig.gimbal()["roi"], 1)
        expect(abs(roi["altitude_amsl_m"] - HOME_AMSL) < 1, f"the page shows {roi}")
        self.camera.wait_at(pitch=PITCH_TO_HOME, yaw_vehicle=90, within=3)
        client.cancel_roi()
        wait_for("no ROI on the page", lambda: self.rig.gimbal()["roi"] is None, 1)
        self.expect_left_to_autopilot(since, 2)

    def does_not_point(self):
        """Client checklist E118: "195 addressed to component 1: no ACK from M"."""
        client, since = self.client, time.monotonic()
        at = self.camera.last()
        client.roi(*HOME, HOME_AMSL)
        self.camera.expect_still(1.5, pitch=at.pitch, yaw_vehicle=at.yaw_vehicle)
        expect(self.rig.gimbal()["roi"] is None, "the page shows a ROI")
        client.cancel_roi()
        self.expect_left_to_autopilot(since, 2)

    def expect_left_to_autopilot(self, since, count):
        """Nothing but the autopilot has answered, and the simulated one knows no such command."""
        client = self.client
        wait_for(lambda: f"the autopilot's answers: {client.errors}", lambda: len(client.errors) == count, 2)
        expect({result for _, result in client.errors} == {UNSUPPORTED}, f"it shows {client.errors}")
        client.errors.clear()
        answers = self.own_answers(since)
        expect(not answers, f"the manager answers: {answers}")


def modern(steps, rig, generation):
    """4.4.1 and later."""
    wire = rig.ground_wire()
    with QGroundControl(wire.port, generation) as client:
        operator = Operator(steps, rig, client, wire)
        step = operator.step
        step("the gimbal appears", operator.appears, essential=True)
        step("acquires and releases control", operator.acquires_and_releases)
        step("centers what nobody holds", operator.centers)
        step("tilts down", operator.tilts)
        step("points by clicks into the picture", operator.clicks)
        step("shows where the camera looks", operator.shows_attitude)
        step("locks yaw and follows", operator.locks)
        step("retracts", operator.retracts)
        step("turns while a button is held", operator.turns)
        step("turns while locked", operator.turns_locked)
        step("a rate ends when the program is gone", operator.rate_ends)
        if generation.has_gimbal_rate:
            step("a rate of another part of the program ends", operator.gimbal_rate_ends)
        step("drags", operator.drags)
        with GroundStation(rig.ground_port, 254, device=rig.kind.device) as other:
            step("asks the operator while another has control", lambda: operator.another_has_control(other))
            step("takes control over", lambda: operator.takes_over(other))
        step("lost no click", operator.ends)


def points(steps, rig, generation, is_obeyed):
    wire = rig.ground_wire()
    with QGroundControl(wire.port, generation) as client:
        operator = Operator(steps, rig, client, wire)
        operator.step("the gimbal appears", operator.appears, essential=True)
        operator.center()
        if is_obeyed:
            operator.step("a click on the map is obeyed", lambda: operator.points_by_autopilot(False))
            operator.step("a click on the map by COMMAND_LONG", lambda: operator.points_by_autopilot(True))
        else:
            operator.step("a click on the map is the autopilot's", operator.does_not_point)
        client.release()
        rig.wait_owners(None)


def first_4_4(steps, rig, is_obeyed):
    """4.4.0, whose commands for a manager go to the autopilot."""
    wire = rig.ground_wire()
    with QGroundControl(wire.port, FIRST_4_4) as client:
        operator, camera, active = Operator(steps, rig, client, wire), rig.camera, lambda: client.active

        def obeyed(action, count, **wanted):
            since = time.monotonic()
            action()
            camera.wait_at(**wanted)
            operator.expect_left_to_autopilot(since, count)

        def not_obeyed():
            at, since = camera.last(), time.monotonic()
            client.tilt_90()
            camera.expect_still(1.5, pitch=at.pitch, yaw_vehicle=at.yaw_vehicle)
            rig.wait_owners(None)
            operator.expect_left_to_autopilot(since, 2)

        def centers():
            """Client checklist E79: "zero is not a limit of zero"."""
            # Control first, as it has none.
            obeyed(client.tilt_90, 2, pitch=-90)
            wait_for("control", lambda: active().have_control, 0.5)
            rig.wait_owners(OWN)
            obeyed(client.center, 1, pitch=0, yaw_vehicle=0)

        def clicks():
            pitch, yaw = client.click(0.5, -0.75)
            camera.wait_at(pitch=pitch, yaw_vehicle=yaw)

        def locks():
            """Client checklist E80: "lock state changes, gimbal stays where it is"."""
            north, since = camera.last().yaw_north, time.monotonic()
            client.set_yaw_lock(True)
            wait_for("the label 'Yaw locked'", lambda: active().label == "Yaw locked", 0.5)
            camera.expect_still(1.5, yaw_north=north, within=3)
            client.set_yaw_lock(False)
            wait_for("the label 'Yaw follow'", lambda: active().label == "Yaw follow", 0.5)
            at = camera.last()
            camera.expect_still(1.0, yaw_vehicle=at.yaw_vehicle, within=3)
            operator.expect_left_to_autopilot(since, 2)

        def goes_home():
            since = time.monotonic()
            client.neutral()
            camera.wait_at(pitch=0, yaw_vehicle=0)
            wait_for("the gimbal's flag neutral", lambda: "neutral" in rig.gimbal()["flags"], 1)
            operator.retract_and_center()
            operator.expect_left_to_autopilot(since, 4)

        def turns():
            client.press(yaw=1)
            operator.expect_smooth("yaw_vehicle", 20)
            client.let_go()
            camera.wait_still("yaw_vehicle", 2)

        def releases():
            since = time.monotonic()
            client.release()
            wait_for("no control", lambda: not active().have_control, 0.5)
            rig.wait_owners(None)
            operator.expect_left_to_autopilot(since, 1)

        step = operator.step
        step("the gimbal appears", operator.appears, essential=True)
        if not is_obeyed:
            step("cannot steer without snooping", not_obeyed)
            return
        step("takes control, tilts and centers", centers)
        step("points by clicks into the picture", clicks)
        step("locks yaw and follows", locks)
        step("goes to neutral and retracts", goes_home)
        step("turns while a button is held", turns)
        step("releases control", releases)


def qt5(steps, rig, is_obeyed):
    """4.2 and 4.3, who know the older protocol only."""
    wire = rig.ground_wire()
    with Qt5QGroundControl(wire.port) as client:
        operator, camera = Operator(steps, rig, client, wire), rig.camera

        def obeyed():
            since = time.monotonic()
            for pitch, yaw in ((-30, 20), (-60, -45), (0, 0)):
                client.point(pitch, yaw)
                camera.wait_at(pitch=pitch, yaw_vehicle=yaw)
            expect(not operator.own_answers(since), f"the manager answers: {operator.own_answers(since)}")

        def not_obeyed():
            at, since = camera.last(), time.monotonic()
            client.point(-30, 20)
            camera.expect_still(1.5, pitch=at.pitch, yaw_vehicle=at.yaw_vehicle)
            expect(not operator.own_answers(since), f"the manager answers: {operator.own_answers(since)}")

        wait_for("its start-up", lambda: client.check() or client.gate_at, 20)
        if is_obeyed:
            operator.step("steers by DO_MOUNT_CONTROL", obeyed)
        else:
            operator.step("cannot steer without snooping", not_obeyed)


def exclusive(steps, rig):
    """Where nobody takes control from a holder."""
    wire = rig.ground_wire()
    with QGroundControl(wire.port, NEWEST) as client, GroundStation(rig.ground_port, 254, device=rig.kind.device) as other:
        operator = Operator(steps, rig, client, wire)

        def is_refused():
            expect(other.configure(other.ids) == ACCEPTED, "the other could not take control")
            wait_for("others in control", lambda: client.active.others_have_control, 0.5)
            client.acquire()
            wait_for("an error", lambda: client.errors, 1)
            expect(client.errors == [(CONFIGURE, DENIED)], f"it shows {client.errors}")
            client.errors.clear()
            rig.wait_owners("{}/{}".format(*other.ids))
            expect(other.configure((-3, -3)) == ACCEPTED, "the other could not release control")
            wait_for("nobody in control", lambda: not client.active.others_have_control, 0.5)
            client.center()
            wait_for("control", lambda: client.active.have_control, 0.5)
            expect(other.configure(other.ids) == DENIED, "the other took control")
            client.release()
            rig.wait_owners(None)
            operator.expect_no_error()

        operator.step("the gimbal appears", operator.appears, essential=True)
        operator.step("shows that it does not get control", is_refused)


def without_snooping(steps):
    with Rig("qgroundcontrol-px4") as rig:
        modern(steps, rig, NEWEST)
        modern(steps, rig, LINE_2024)
        points(steps, rig, NEWEST, is_obeyed=False)
        first_4_4(steps, rig, is_obeyed=False)
        qt5(steps, rig, is_obeyed=False)


def with_snooping(steps):
    with Rig("qgroundcontrol-ardupilot", autopilot="ardupilot", settings=SNOOP) as rig:
        modern(steps, rig, EARLY_2026)
        for generation in (LINE_2024, EARLY_2026, NEWEST):
            points(steps, rig, generation, is_obeyed=True)
        first_4_4(steps, rig, is_obeyed=True)
        qt5(steps, rig, is_obeyed=True)
    with Rig("qgroundcontrol-px4-snooping", settings=SNOOP + EXCLUSIVE) as rig:
        points(steps, rig, NEWEST, is_obeyed=True)
        exclusive(steps, rig)


def with_another_gimbal(steps, gimbal):
    """What its operator does does not depend on the gimbal, but for what that can do."""
    with Rig("qgroundcontrol", settings=SNOOP, gimbal=gimbal) as rig:
        for generation in (LINE_2024, EARLY_2026, NEWEST):
            modern(steps, rig, generation)
        for generation in (LINE_2024, EARLY_2026, NEWEST):
            points(steps, rig, generation, is_obeyed=True)
        first_4_4(steps, rig, is_obeyed=True)
        qt5(steps, rig, is_obeyed=True)


def main():
    gimbal = gimbals.chosen()
    steps = Steps(f"QGroundControl{gimbal.suffix}")

    def run():
        if gimbal is not gimbals.MAVLINK_V2:
            with_another_gimbal(steps, gimbal)
            return
        with concurrent.futures.ThreadPoolExecutor() as pool:
            for flight in [pool.submit(flight, steps) for flight in (without_snooping, with_snooping)]:
                flight.result()

    steps.script(run)


main()
