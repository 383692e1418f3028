#!/usr/bin/env python3
"""How the motion of a device leads an instrument."""
import math
import os
import random
import sys
import types
import unittest

CHECKOUT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, os.path.join(CHECKOUT, 'python'))
try:
    import geometry_msgs.msg  # noqa: F401
except ImportError:  # where no ROS is set up, for what needs none of it
    sys.modules['geometry_msgs'] = types.ModuleType('geometry_msgs')
    sys.modules['geometry_msgs.msg'] = types.ModuleType('geometry_msgs.msg')
    for message in ('Point', 'PoseStamped', 'Quaternion'):
        setattr(sys.modules['geometry_msgs.msg'], message, object)
from meshless_surgery.teleoperation import (AXES, HandMap, NO_TURN, inverse, limited, of_axes, of_rpy, of_turn,  # noqa: E402
                                            product, turned, unit)


class TeleoperationTest(unittest.TestCase):

    def setUp(self):
        self.random = random.Random(7)

    def vector(self, size=1.0):
        return tuple(self.random.uniform(-size, size) for _ in range(3))

    def turn(self):
        return of_turn(self.vector(3.0))

    def near(self, a, b, within=1e-12):
        self.assertEqual(len(a), len(b))
        for x, y in zip(a, b):
            self.assertAlmostEqual(x, y, delta=within)

    def same_turn(self, a, b):
        self.near(a, b if sum(x * y for x, y in zip(a, b)) > 0 else tuple(-c for c in b))

    def test_turns_keep_lengths_and_follow_each_other(self):
        for _ in range(100):
            a, b, v = self.turn(), self.turn(), self.vector()
            self.near(turned(a, turned(b, v)), turned(product(a, b), v))
            self.assertAlmostEqual(math.hypot(*v), math.hypot(*turned(a, v)))
            self.same_turn(NO_TURN, product(a, inverse(a)))
        self.near(turned(of_turn((0, 0, math.pi / 2)), (1, 0, 0)), (0, 1, 0))
        self.near(turned(of_rpy(0.0, 0.0, math.pi / 2), (0, 1, 0)), (-1, 0, 0))
        self.near(turned(of_rpy(math.pi / 2, 0.0, math.pi / 2), (0, 1, 0)), (0, 0, 1))
        self.assertIsNone(unit((0, 0, 0, 0)))
        self.assertIsNone(unit((0, math.nan, 0, 1)))

    def test_axes_are_those_that_are_named(self):
        for words in ('right away up', 'right up back', 'left up away', 'down right back', 'back right up'):
            for axis, word in zip(((1, 0, 0), (0, 1, 0), (0, 0, 1)), words.split()):
                self.near(turned(of_axes(words), axis), AXES[word])
        for words, why in (('right up away', 'right-handed'), ('right right up', 'right-handed'), ('right up', 'three of'), ('right up forth', 'three of')):
            with self.assertRaisesRegex(ValueError, why):
                of_axes(words)

    def test_an_instrument_goes_as_the_hand_goes(self):
        """Of a Touch, whose y is up, seen by one who looks along the world's -x: that is away."""
        hand = HandMap('right up back', of_rpy(0.0, 0.0, math.pi / 2), scale=2.0)
        self.assertFalse(hand.holds)
        hand.hold(((0.1, 0.2, 0.3), NO_TURN), ((1, 1, 1), NO_TURN))
        self.assertTrue(hand.holds)
        for way, goes in (((0.01, 0, 0), (0, 0.02, 0)), ((0, 0.01, 0), (0, 0, 0.02)), ((0, 0, 0.01), (0.02, 0, 0))):
            place, turn = hand.instrument((tuple(a + b for a, b in zip((0.1, 0.2, 0.3), way)), NO_TURN))
            self.near(place, tuple(1 + g for g in goes))
            self.same_turn(turn, NO_TURN)
        # A turn about what is up to the hand is one about what is up in the world.
        self.same_turn(hand.instrument(((0.1, 0.2, 0.3), of_turn((0, 0.5, 0))))[1], of_turn((0, 0, 0.5)))
        hand.release()
        self.assertFalse(hand.holds)

    def test_nothing_jumps_where_the_hand_takes_hold_again(self):
        for _ in range(100):
            hand = HandMap(self.random.choice(('right away up', 'right up back', 'left up away')), self.turn(),
                           self.random.uniform(0.1, 5.0))
            device, instrument = (self.vector(), self.turn()), (self.vector(), self.turn())
            for _ in range(5):
                hand.hold(device, instrument)
                place, turn = hand.instrument(device)
                self.near(place, instrument[0])
                self.same_turn(turn, instrument[1])
                instrument = hand.instrument((self.vector(), self.turn()))
                hand.release()
                device = (self.vector(), self.turn())

    def test_what_pushes_the_instrument_pushes_the_hand_back(self):
        for _ in range(100):
            hand = HandMap('right up back', self.turn(), 1.0)
            begin = (self.vector(), self.turn())
            hand.hold(begin, (self.vector(), self.turn()))
            force, way = self.vector(), self.vector(0.1)
            place, _ = hand.instrument((tuple(a + b for a, b in zip(begin[0], way)), begin[1]))
            goes = tuple(a - b for a, b in zip(place, hand.instrument(begin)[0]))
            # Work on the instrument is work on the hand.
            self.assertAlmostEqual(sum(a * b for a, b in zip(force, goes)),
                                   sum(a * b for a, b in zip(hand.to_device(force), way)), 12)
            self.near(hand.to_world(hand.to_device(force)), force)
        self.near(limited((3, 0, 4), 1.0), (0.6, 0, 0.8))
        self.near(limited((3, 0, 4), 6.0), (3, 0, 4))


if __name__ == '__main__':
    unittest.main()
