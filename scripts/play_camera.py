#!/usr/bin/env python3
"""Plays the task camera by the topic of its endoscope: it shows the balls in the cups one after the other, drawn back in between."""
import math
import os
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from surgery_client import Play, quaternion_of_axes  # noqa: E402

from meshless_surgery.poses import cross, normalised  # noqa: E402

STEPS, CHUNK = 4, 4 / 120        # of the world between two poses, and how long they take [s]
TROCAR, LEAN = (0.0, -0.11, 0.15), math.radians(30)
TILT = math.radians(23)          # between the axis of a cup and the direction to the trocar, to this side of it [degrees]:
CUPS = {'white': 0, 'red': 100, 'yellow': -100, 'green': -75, 'blue': 75}
BACK = 0.09                      # [m] of the tip from the trocar, above the cups


def scaled(s, a):
    return tuple(s * p for p in a)


def add(*all_of_them):
    return tuple(sum(p) for p in zip(*all_of_them))


def dot(a, b):
    return sum(p * q for p, q in zip(a, b))


def minus(a, b):
    return add(a, scaled(-1, b))


def towards(tip, up):
    """A pose: the tip there, the shaft through the trocar, z as near to `up` as it can be."""
    x = normalised(minus(tip, TROCAR))
    y = normalised(cross(up, x))
    return tip, quaternion_of_axes(x, y, cross(x, y))


def view(ball, side):
    """From where the line of sight is along the axis of the ball's cup."""
    away = normalised(minus(TROCAR, ball))
    above = normalised(add((0, 0, 1), scaled(-away[2], away)))
    aside = cross(away, above)
    axis = normalised(add(scaled(math.cos(TILT), away),
                    scaled(math.sin(TILT), add(scaled(math.cos(side), above), scaled(math.sin(side), aside)))))
    near, far = 0.03, 0.12
    for _ in range(50):
        middle = (near + far) / 2
        shaft = normalised(minus(add(ball, scaled(middle, axis)), TROCAR))
        near, far = (middle, far) if math.acos(-dot(shaft, axis)) < LEAN else (near, middle)
    eye = add(ball, scaled(near, axis))
    return towards(eye, add(axis, scaled(math.cos(LEAN), normalised(minus(eye, TROCAR)))))


def between(a, b, s):
    """Of two rotations, the shorter way."""
    if sum(p * q for p, q in zip(a, b)) < 0:
        b = scaled(-1, b)
    return normalised(add(scaled(1 - s, a), scaled(s, b)))


class Scope:
    def __init__(self, surgeon):
        self.surgeon, self.stream = surgeon, surgeon.stream('scope')
        pose = next(i.pose for i in surgeon.state().instruments if i.name == 'scope')
        self.now = ((pose.position.x, pose.position.y, pose.position.z),
                    (pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w))

    def go(self, seconds, pose):
        """Smoothly."""
        stepped = self.surgeon.is_stepped
        begun = 0.0 if stepped else self.surgeon.state().sim_time
        u = sent = 0.0
        while sent < 1:
            sent = min(1.0, u + CHUNK / seconds)
            s = sent * sent * sent * (10 - 15 * sent + 6 * sent * sent)
            self.stream.move(add(scaled(1 - s, self.now[0]), scaled(s, pose[0])), between(self.now[1], pose[1], s))
            if stepped:
                if sent == 1:
                    time.sleep(0.03)  # the last pose may not be there yet
                self.surgeon.step(STEPS)
                u = sent
            else:
                u = (self.surgeon.state().sim_time - begun) / seconds
        self.now = pose

    def visit(self, pose):
        def back(of):
            return add(TROCAR, scaled(BACK, normalised(minus(of[0], TROCAR)))), of[1]
        self.go(0.5, back(self.now))
        self.go(1.5, back(pose))
        self.go(1.0, pose)


def middle_of(surgeon, name):
    places = [(p.x, p.y, p.z) for p in surgeon.body(name).surface.vertices]
    return scaled(1 / len(places), add(*places))


def scenario(surgeon, play):
    surgeon.start_task('camera', 'play_camera', allow=['pause', 'slow'])
    if surgeon.is_stepped:
        surgeon.stepped()
    surgeon.live(0.5)
    scope = Scope(surgeon)
    for number, (ball, side) in enumerate(CUPS.items()):
        scope.visit(view(middle_of(surgeon, ball), math.radians(side)))
        surgeon.live(1.5)
        stages = surgeon.observe().task.stage
        play.check(stages == number + 1, 'the endoscope shows %s: %d stages are met' % (ball, stages))
    report = surgeon.report()
    play.check(report.passed, 'score %.1f, %s: %s' % (report.score, 'passed' if report.passed else 'not passed', report.folder))


if __name__ == '__main__':
    play = Play(__doc__)
    sys.exit(play.run(scenario))
