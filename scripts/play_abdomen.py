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


def lumen(surgeon, names, x):
    """[m] How far apart opposite walls are, in the mean, near x in the rest shape: there, and now, over the pieces of a vessel."""
    rest, now = (numpy.concatenate([points(surgeon.body(name, rest).surface.vertices) for name in names]) for rest in (True, False))
    near = numpy.abs(rest[:, 0] - x) < STRIP
    rest, now = rest[near], now[near]
    arm = (rest - rest.mean(axis=0))[:, 1:]
    radius = numpy.linalg.norm(arm, axis=1)
    above = numpy.flatnonzero((radius < 0.8 * radius.max()) & (arm[:, 1] > 0.2 * radius.max()))
    # Of each inner place above, the one below it.
    below = [numpy.linalg.norm(rest - rest[i] + (0, 0, 2 * arm[i, 1]), axis=1).argmin() for i in above]
    return [float(numpy.abs(ends[above] - ends[below])[:, 2].mean()) for ends in (rest, now)]


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
        was, now = lumen(surgeon, [name], x)
        play.check(now < 0.2 * was, 'the %s is closed at x = %.0f mm: %.2f of %.2f mm are left' % (name, 1e3 * x, 1e3 * now, 1e3 * was))
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
    drawn = whole
    while drawn > 0.7 * whole and at[2] > 0.04:
        at += (-0.0005, 0.0, -0.001)
        surgeon.move(pick.pick_id, tuple(at))
        surgeon.live(0.05)
        drawn = bed(surgeon).fibres
    play.check(drawn < whole, 'the pull at the neck has torn %d of %d fibres' % (whole - drawn, whole))
    surgeon.push((0.03, -0.02, 0.122), radius=0.008)
    surgeon.push((-0.06, -0.02, 0.114), radius=0.008, speed=0.04)
    surgeon.live(2.5)
    peeled = bed(surgeon).fibres
    play.check(peeled < drawn, 'the sphere between gallbladder and liver has peeled off %d more' % (drawn - peeled))
    surgeon.lift_push()
    while at[2] > 0.05 or bed(surgeon).fibres and at[2] > 0.02:  # down, off what is left of the bed
        at[2] -= 0.002
        surgeon.move(pick.pick_id, tuple(at))
        surgeon.live(0.06)
    while at[1] > -0.14:  # and out to the front
        at[1] -= 0.003
        surgeon.move(pick.pick_id, tuple(at))
        surgeon.live(0.06)
    surgeon.lock(pick.pick_id, tuple(at))
    surgeon.live(1.0)

    state, after, liver = surgeon.state(), surgeon.body('gallbladder'), surgeon.body('liver')
    play.check(bed(surgeon).fibres == 0, 'no fibre of the bed is left')
    back = numpy.mean([v.y for v in after.surface.vertices])
    front = min(v.y for v in liver.surface.vertices)
    play.check(back < front, 'its middle is at y = %.0f mm, in front of the liver, which begins at %.0f mm' % (1e3 * back, 1e3 * front))
    cavity = after.cavities[0]
    play.check(not cavity.open and abs(cavity.volume / before.cavities[0].volume - 1) < 0.05,
               'it is whole, and holds %.1f ml' % (1e6 * cavity.volume))
    play.check([b.name for b in state.bodies if b.name.startswith('liver')] == ['liver'], 'the liver is whole')
    for name, names in pieces.items():
        clips = clips_of(state, name)
        play.check(len(clips) == 2 and all(c.fibres == c.made for c in clips.values()), 'both clips of the %s hold' % name)
        for x in CLIPS[name][1:]:  # of what stays
            was, now = lumen(surgeon, names, x)
            play.check(now < 0.2 * was, 'the %s is still closed at x = %.0f mm: %.2f of %.2f mm' % (name, 1e3 * x, 1e3 * now, 1e3 * was))
    play.say('real-time factor %.2f' % state.real_time_factor)


if __name__ == '__main__':
    play = Play(__doc__)
    sys.exit(play.run(scenario))
