#!/usr/bin/env python3
"""Plays the task peg_transfer by the topics of its two graspers: each triangle is lifted off its peg, handed over in the air and
put on a peg of the other side, all six, and back."""
import math
import os
import sys
import time

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
from surgery_client import Play  # noqa: E402

STEPS, CHUNK = 4, 4 / 120    # of the world between two poses, and how long they take [s]
OPEN = 0.3                   # [rad]
WALL, TOP = 0.006, 0.0045    # [m] from the middle of a triangle to that of a wall, and up to its top
DEPTH, BESIDE = 0.0045, 0.003  # [m] of the tips below the top, and beside the middle of the wall
AWAY, LIFT = 0.025, 0.03     # [m] along the shaft, and up
HASTE = 0.85                 # of the times below
ORDER = (4, 5, 6, 1, 2, 3)   # those in the middle of the board first


def side_of(hand):
    return -1.0 if hand == 'left' else 1.0


def turned(hand, yaw):
    """Down at 60 degrees from the hand's side, then turned about z."""
    down = math.pi / 3 if hand == 'left' else 2 * math.pi / 3
    c, s, cz, sz = math.cos(down / 2), math.sin(down / 2), math.cos(yaw / 2), math.sin(yaw / 2)
    return (-sz * s, cz * s, sz * c, cz * c)


def back(hand, yaw, way):
    """So far out along the shaft."""
    across, up = 0.5 * way * side_of(hand), math.sqrt(0.75) * way
    return (across * math.cos(yaw), across * math.sin(yaw), up)


def add(a, b):
    return tuple(p + q for p, q in zip(a, b))


class Hands:
    def __init__(self, surgeon):
        self.surgeon = surgeon
        self.streams = {hand: surgeon.stream(hand) for hand in ('left', 'right')}
        self.held = {}  # place, yaw, jaw
        for instrument in surgeon.state().instruments:
            place = instrument.pose.position
            self.held[instrument.name] = ((place.x, place.y, place.z), 0.0, instrument.jaw)
        self.rest = {'triangle_%d' % k: self.points('triangle_%d' % k, True) for k in ORDER}

    def points(self, name, rest=False):
        return [(p.x, p.y, p.z) for p in self.surgeon.body(name, rest).surface.vertices]

    def where(self, name):
        """The middle of a triangle and how far it is turned about z, by less than a third of a turn."""
        now, rest = self.points(name), self.rest[name]
        count = len(now)
        middle = tuple(sum(p[k] for p in now) / count for k in range(3))
        begin = tuple(sum(p[k] for p in rest) / count for k in range(3))
        sine = cosine = 0.0
        for p, q in zip(now, rest):
            x, y, u, v = p[0] - middle[0], p[1] - middle[1], q[0] - begin[0], q[1] - begin[1]
            cosine += u * x + v * y
            sine += u * y - v * x
        return middle, math.remainder(math.atan2(sine, cosine), 2 * math.pi / 3)

    def wall(self, name, hand):
        """Where a hand's tip grasps it, by the wall that faces -y most, and how that is turned."""
        middle, yaw = self.where(name)
        beside = side_of(hand) * BESIDE
        return add(middle, (WALL * math.sin(yaw) + beside * math.cos(yaw),
                            -WALL * math.cos(yaw) + beside * math.sin(yaw), TOP - DEPTH)), yaw

    def go(self, seconds, ways):
        """Hands go together, smoothly: by hand a place, a yaw and an angle of the jaws."""
        seconds *= HASTE
        stepped = self.surgeon.is_stepped
        begun = 0.0 if stepped else self.surgeon.state().sim_time
        u = sent = 0.0
        while sent < 1:
            sent = min(1.0, u + CHUNK / seconds)
            s = sent * sent * sent * (10 - 15 * sent + 6 * sent * sent)
            for hand, (place, yaw, jaw) in ways.items():
                was, was_yaw, was_jaw = self.held[hand]
                self.streams[hand].move(tuple(p + s * (q - p) for p, q in zip(was, place)),
                                        turned(hand, was_yaw + s * (yaw - was_yaw)))
                self.streams[hand].jaw(was_jaw + s * (jaw - was_jaw))
            if stepped:
                if sent == 1:
                    time.sleep(0.03)  # the last pose may not be there yet
                self.surgeon.step(STEPS if sent < 1 else 2 * STEPS)
                u = sent
            else:
                u = (self.surgeon.state().sim_time - begun) / seconds
        self.held.update(ways)

    def holds(self, hand):
        return next(i.holds for i in self.surgeon.state().instruments if i.name == hand)

    def grasp(self, hand, name, near=False):
        """By a wall, and once more where it was missed: where the tip is then, and how it is turned."""
        for _ in range(3):
            at, yaw = self.wall(name, hand)
            if not near:
                self.go(0.5, {hand: (add(at, back(hand, yaw, AWAY)), yaw, OPEN)})
            self.go(0.35, {hand: (at, yaw, OPEN)})
            self.go(0.2, {hand: (at, yaw, 0.0)})
            if self.holds(hand) == name:
                break
            self.go(0.2, {hand: (at, yaw, OPEN)})
            near = False
        return at, yaw

    def transfer(self, name, giver, taker, peg):
        side = side_of(giver)
        at, yaw = self.grasp(giver, name)
        at = add(at, (0, 0, LIFT))
        self.go(0.45, {giver: (at, yaw, 0.0)})
        middle = (side * 0.004, -0.006, at[2])
        self.go(0.5, {giver: (middle, 0.0, 0.0),
                      taker: (add(add(middle, (-side * 0.006, 0, 0)), back(taker, 0.0, AWAY)), 0.0, OPEN)})
        _, yaw = self.grasp(taker, name, near=True)
        self.go(0.2, {giver: (middle, 0.0, OPEN)})
        self.go(0.2, {giver: (add(middle, back(giver, 0.0, AWAY)), 0.0, OPEN)})
        for seconds in (0.5, 0.1):  # it turns a little on the way
            place, (centre, yaw) = self.held[taker][0], self.where(name)
            self.go(seconds, {taker: ((place[0] + peg[0] - centre[0], place[1] + peg[1] - centre[1], place[2]), yaw, 0.0)})
        low = add(self.held[taker][0], (0, 0, min(0.0, 0.009 - self.where(name)[0][2])))
        self.go(0.4, {taker: (low, yaw, 0.0)})
        self.go(0.2, {taker: (low, yaw, OPEN)})
        self.go(0.25, {taker: (add(low, back(taker, yaw, AWAY)), yaw, OPEN)})


def pegs(side):
    """The feet of the pegs of a side, by their numbers: the scene's places."""
    places = [(x, y) for x in (0.052, 0.027) for y in (0.026, 0.0, -0.026)]
    return {k + 1: (side * x, y) for k, (x, y) in enumerate(places)}


def scenario(surgeon, play):
    surgeon.start_task('peg_transfer', 'play_peg_transfer', allow=['pause', 'slow'])
    if surgeon.is_stepped:
        surgeon.stepped()
    surgeon.live(0.5)
    hands = Hands(surgeon)
    for giver, taker in (('left', 'right'), ('right', 'left')):
        free = pegs(side_of(taker))
        for k, number in enumerate(ORDER):
            # On the other side those that are far from the middle come first.
            goal = number if giver == 'right' else ORDER[(k + 3) % 6]
            name = 'triangle_%d' % number
            for _ in range(3):  # what was lost is taken up again
                hands.transfer(name, giver, taker, free[goal])
                middle, _ = hands.where(name)
                beside = math.hypot(middle[0] - free[goal][0], middle[1] - free[goal][1])
                if beside < 0.004:
                    break
            play.check(beside < 0.004 and middle[2] < 0.012,
                       '%s is on %s_%d, %.1f mm beside its middle' % (name, taker, goal, 1000 * beside))
    surgeon.live(1.0)
    report = surgeon.report()
    play.check(report.passed, 'score %.1f, %s: %s' % (report.score, 'passed' if report.passed else 'not passed', report.folder))


if __name__ == '__main__':
    play = Play(__doc__)
    sys.exit(play.run(scenario))
