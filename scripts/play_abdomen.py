#!/usr/bin/env python3
"""Plays the abdomen scene: duct and artery are clipped and cut between the clips, the gallbladder is peeled off the liver with a
pick and the push sphere, and lifted out."""
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.realpath(__file__)))
import numpy  # noqa: E402
from surgery_client import Play  # noqa: E402

ALONG, UP = (1, 0, 0), (0, 0, 1)
CLIPS = {'duct': (0.021, 0.034), 'artery': (0.011, 0.024)}  # [m] along x, as the scene places them
STRIP = 0.002  # [m] on each side of a place: what is measured there


def points(vertices):
    return numpy.array([(v.x, v.y, v.z) for v in vertices])


def middle(surgeon, name, x):
    """Where the section of a vessel is now that is at x in the rest shape."""
    rest, now = (points(surgeon.body(name, rest).surface.vertices) for rest in (True, False))
    return now[numpy.abs(rest[:, 0] - x) < STRIP].mean(axis=0)


def opening(surgeon, names, x):
    """[m] How wide the lumen is where x is in the rest shape, as it was and now, over the pieces of a vessel."""
    rest, now = (numpy.concatenate([points(surgeon.body(name, rest).surface.vertices) for name in names]) for rest in (True, False))
    near = numpy.abs(rest[:, 0] - x) < STRIP
    rest, now = rest[near], now[near]
    radius = numpy.linalg.norm((rest - rest.mean(axis=0))[:, 1:], axis=1)
    walls = radius < 0.75 * radius.max()  # inner ones
    middle_of = numpy.abs(rest[:, 1] - rest[:, 1].mean()) < 0.001  # above and below each other
    chosen = walls & middle_of
    above = chosen & (rest[:, 2] > rest[:, 2].mean())
    below = chosen & (rest[:, 2] < rest[:, 2].mean())
    return [float(p[above][:, 2].mean() - p[below][:, 2].mean()) for p in (rest, now)]


def clips_of(state, prefix):
    return {a.name: a for a in state.attachments if a.jaws > 0 and a.name.startswith(prefix)}


def bed(surgeon):
    return [a for a in surgeon.state().attachments if a.name == 'bed'][0]


def divide(surgeon, play, name):
    """Two clips on a vessel, and the cut between them."""
    for x in CLIPS[name]:
        surgeon.clip(tuple(middle(surgeon, name, x)), UP, width=0.004, body=name)
    surgeon.live(0.7)
    for x in CLIPS[name]:
        was, now = opening(surgeon, [name], x)
        play.check(now < 0.15 * was, 'the %s is closed at x = %.0f mm: %.2f of %.2f mm are left' % (name, 1e3 * x, 1e3 * now, 1e3 * was))
    between = middle(surgeon, name, sum(CLIPS[name]) / 2)
    with surgeon.still():
        cut = surgeon.cut(pivot=tuple(between - numpy.array((0, 0.02, 0))), reach=(0, 1, 0), normal=ALONG, length=0.04, width=0.02,
                          bodies=[name])
    play.check(len(cut.new_bodies) == 2, 'the %s is cut into %s' % (name, ' and '.join(cut.new_bodies)))
    ends = sorted(end for clip in clips_of(surgeon.state(), name).values() for end in clip.ends)
    play.check(ends == sorted(cut.new_bodies), 'there is a clip on each piece')
    return cut.new_bodies


def scenario(surgeon, play):
    surgeon.live(3.0)
    before = surgeon.body('gallbladder')
    whole = bed(surgeon).fibres
    play.say('the gallbladder holds %.1f ml, on %d fibres' % (1e6 * before.cavities[0].volume, whole))
    pieces = {name: divide(surgeon, play, name) for name in CLIPS}

    # The neck is free: it is drawn down, off the bed, and the sphere follows between the two.
    neck = max(surgeon.body('gallbladder').surface.vertices, key=lambda v: v.x)
    pick = surgeon.pick((neck.x, neck.y, neck.z), body='gallbladder')
    at = numpy.array((pick.position.x, pick.position.y, pick.position.z))
    for k in range(12):
        at += (-0.0015, -0.001, -0.003)
        surgeon.move(pick.pick_id, tuple(at))
        surgeon.live(0.15)
    drawn = bed(surgeon).fibres
    play.check(drawn < whole, 'the pull at the neck has torn %d of %d fibres' % (whole - drawn, whole))
    surgeon.push((0.03, -0.02, 0.122), radius=0.008)
    surgeon.push((-0.06, -0.02, 0.114), radius=0.008, speed=0.04)
    surgeon.live(2.5)
    peeled = bed(surgeon).fibres
    play.check(peeled < drawn, 'the sphere between gallbladder and liver has peeled off %d more' % (drawn - peeled))
    surgeon.lift_push()
    for k in range(40):
        if k > 12 and bed(surgeon).fibres == 0:
            break
        at += (0.0, -0.003, -0.002 if at[2] > 0.06 else 0.0)
        surgeon.move(pick.pick_id, tuple(at))
        surgeon.live(0.1)
    surgeon.lock(pick.pick_id, tuple(at))
    surgeon.live(1.0)

    state, after, liver = surgeon.state(), surgeon.body('gallbladder'), surgeon.body('liver')
    play.check(bed(surgeon).fibres == 0, 'no fibre of the bed is left')
    top = max(v.y for v in after.surface.vertices)
    front = min(v.y for v in liver.surface.vertices)
    play.say('the gallbladder is at y = %.0f mm and before, the liver begins at %.0f mm' % (1e3 * top, 1e3 * front))
    low = max(v.z for v in after.surface.vertices) < min(v.z for v in liver.surface.vertices)
    play.check(top < front or low, 'it is out from under the liver')
    cavity = after.cavities[0]
    play.check(not cavity.open and abs(cavity.volume / before.cavities[0].volume - 1) < 0.05,
               'it is whole, and holds %.1f ml' % (1e6 * cavity.volume))
    play.check([b.name for b in state.bodies if b.name.startswith('liver')] == ['liver'], 'the liver is whole')
    for name, names in pieces.items():
        for x in CLIPS[name]:
            was, now = opening(surgeon, names, x)
            play.check(now < 0.2 * was, 'the %s is still closed at x = %.0f mm: %.2f of %.2f mm' % (name, 1e3 * x, 1e3 * now, 1e3 * was))
    play.say('real-time factor %.2f' % state.real_time_factor)


if __name__ == '__main__':
    play = Play(__doc__)
    sys.exit(play.run(scenario))
