"""A stand-in for an arm on a table: a MuJoCo arm behind the calls of LeRobot's ``Robot``, in a time of its own.

arm, table = on_table(write(folder / "arm.xml"), noise=0.1); arm.execute([], theta, rng); assert not table.torque
"""

import os
import re
import signal
from functools import partial

import mujoco
import numpy as np

from sgimd_torch.calls import with_keywords_of
from sgimd_torch.extras.lerobot.arm import LeRobotArm


class Clock:
    """Time that passes when somebody waits, when the arm takes its time to answer, and a little at each look."""

    def __init__(self):
        self.now = 0.0

    def monotonic(self):
        self.now += 1e-7
        return self.now

    def sleep(self, seconds):
        assert seconds >= 0
        self.now += seconds


def write(path, lengths=(0.2, 0.2, 0.2), offsets=(0.0, 0.0, 0.0), names=("joint0", "joint1", "joint2"), kp=60):
    """A model of a planar arm, whose joints have their zeros shifted by ``offsets`` (degrees)."""
    bodies, ends, x = "", "", 0
    for name, length, offset in zip(names, lengths, offsets, strict=True):
        bodies += f'<body pos="{x} 0 .1" euler="0 0 {offset}"><joint name="{name}" axis="0 0 1" range="-100 100"/>'
        bodies += f'<geom type="capsule" fromto="0 0 0 {length} 0 0" size=".02"/>'
        ends, x = ends + "</body>", length
    servos = "".join(f'<position joint="{name}" kp="{kp}" kv="{kp / 10}"/>' for name in names)
    path.write_text(
        '<mujoco><compiler autolimits="true"/><option timestep=".005" integrator="implicitfast" gravity="0 0 0"/>'
        '<default><joint damping="1"/><geom contype="0" conaffinity="0"/></default>'
        f'<worldbody>{bodies}<site name="tip" pos="{x} 0 0"/>{ends}<body name="puck" pos=".3 .3 0"><freejoint/>'
        '<geom size=".03"/></body></worldbody>'
        f"<actuator>{servos}</actuator></mujoco>"
    )
    return path


def upright(path):
    """The model at ``path`` as an arm that moves up and down, 30 mm above a table."""
    text = path.read_text().replace('axis="0 0 1"', 'axis="0 1 0"').replace('contype="0" conaffinity="0"', "")
    table = '<worldbody><geom name="table" type="box" size="1 1 .01" pos="0 0 .04"/>'
    path.write_text(re.sub('<body name="puck".*?</body>', "", text).replace("<worldbody>", table))
    return path


class TableArm:
    """A MuJoCo arm that reads degrees.

    Args:
        path: file of the arm as it was built.
        clock: clock that it moves by.
        noise: standard deviation of what it reads (degrees).
        lost: share of packets that are lost.
        answers: s that each answer takes.
        unit: degrees of one unit that it reads; negative if its motors turn the other way.
        delay: s between a command and its effect.
        frame: function (time, degrees) -> what it reads of them, if that is not what it takes.

    Attributes:
        events: functions to call at a time (s), once.
        torque: whether torque is on; ``switched_off`` is the time when it was switched off last.
        sent: time, positions (degrees) and measured positions of all commands.
        temperature: that of all motors (degrees C).
        unplugged: whether nothing answers.
        overloaded: whether the first motor answers with an error, after which no other motor is asked.
        jammed: whether the first joint is stuck.
        touches: number of steps in which anything touched.
        asked_off: time when torque was to be switched off last, whether motors heard it or not.
    """

    def __init__(self, path, clock, *, noise=0.0, lost=0.0, answers=0.0, unit=1.0, delay=0.0, frame=None):
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.data = mujoco.MjData(self.model)
        self.clock, self.noise, self.lost, self.answers, self.unit = clock, noise, lost, answers, unit
        self.delay, self.frame = delay, frame
        self.rng = np.random.default_rng(0)
        self.joints = [self.model.joint(self.model.actuator_trnid[k, 0]).name for k in range(self.model.nu)]
        self.events, self.sent, self.temperature = {}, [], 30.0
        self.is_connected = self.torque = self.unplugged = self.overloaded = self.jammed = False
        self.switched_off, self.asked_off, self.hand, self.touches = None, None, None, 0

    @property
    def action_features(self):
        return {f"{joint}.pos": float for joint in self.joints}

    @property
    def bus(self):
        return self

    def degrees(self):
        return np.degrees(self.data.qpos[: self.model.nu])

    def connect(self):
        self.check_answer()
        self.is_connected = self.torque = True
        self.data.ctrl[:] = self.data.qpos[: self.model.nu]

    def get_observation(self):
        self.talk()
        told = self.frame(self.clock.now, self.degrees()) if self.frame else self.degrees()
        read = told / self.unit + self.noise * self.rng.standard_normal(self.model.nu)
        return dict(zip(self.action_features, read.tolist(), strict=True))

    def send_action(self, action):
        self.talk()
        values = self.unit * np.array([action[name] for name in self.action_features])
        self.sent.append((self.clock.now, values, self.degrees()))
        if self.torque:  # the motors hear it when the delay is over
            self.events[self.clock.now + self.delay] = partial(self.hear, np.radians(values))

    def hear(self, command):
        self.data.ctrl[:] = command

    def disable_torque(self):
        self.check_answer()
        self.sync_write("Torque_Enable", 0)

    def sync_write(self, name, value):
        """Reaches motors, if any, and waits for no answer."""
        assert (name, value) == ("Torque_Enable", 0)
        self.asked_off = self.clock.now
        if self.torque and not self.unplugged:
            self.torque, self.switched_off = False, self.clock.now

    def sync_read(self, name, normalize):
        assert (name, normalize) == ("Present_Temperature", False)
        self.talk()
        return dict.fromkeys(self.joints, self.temperature)

    def disconnect(self):
        self.disable_torque()
        self.is_connected = False

    def talk(self):
        self.clock.now += self.answers
        self.check_answer()
        if not self.is_connected:
            raise ConnectionError("not connected")
        if self.rng.random() < self.lost:
            raise ConnectionError("a packet was lost")

    def check_answer(self):
        self.clock.now += self.unplugged * 0.034  # as LeRobot waits for a Dynamixel motor
        self.pass_time()
        if self.unplugged:
            raise ConnectionError("no such port")
        if self.overloaded:
            raise RuntimeError("Overload error!")

    def pass_time(self):
        """Move on until now."""
        while self.data.time < self.clock.now:
            for due in [time for time in self.events if time <= self.data.time]:
                self.events.pop(due)()
            before = self.data.qpos[0]
            if self.torque:
                mujoco.mj_step(self.model, self.data)
                self.touches += self.data.ncon > 0
            else:
                self.data.time += self.model.opt.timestep
                self.data.qvel[:] = 0
                if self.hand is not None:  # somebody leads it
                    self.data.qpos[: self.model.nu] = self.hand(self.data.time)
            if self.jammed:
                self.data.qpos[0], self.data.qvel[0] = before, 0


LIVE = []


def make():
    """The arm that lies on the table; it stays there when another driver is made, which is not connected yet."""
    LIVE[-1].is_connected = False
    return LIVE[-1]


def on_table(path, built=None, *, of_arm=(), **options):
    """A `LeRobotArm` by the model at ``path``, and the `TableArm` it drives, which was built as the file ``built``."""
    clock = Clock()
    LIVE.append(TableArm(built or path, clock, **dict(of_arm)))
    given = {"outcome": "site:tip:xy", "units": "deg", "low": (-0.7, -0.7), "high": (0.7, 0.7), "durations": (1.0, 2.0)}
    return LeRobotArm("arms:make", model=str(path), clock=clock, **{**given, **options}), LIVE[-1]


@with_keywords_of(LeRobotArm)
def bench(**options):
    """The arm that lies on the table, by the options of the command line."""
    return LeRobotArm(**{**options, "robot": "arms:make", "clock": LIVE[-1].clock})


def interrupt():
    """Ctrl-C."""
    os.kill(os.getpid(), signal.SIGINT)
