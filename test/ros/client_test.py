#!/usr/bin/env python3
"""The Python client: it goes by what the node says of itself, and sends what changes something once."""
import os
import sys
import unittest

import rospy
from meshless_surgery.msg import Info
from meshless_surgery.srv import Cut

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
sys.path.insert(0, os.path.join(HERE, '..', '..', 'scripts'))
from deformer_support import OwnNode, Recorder, run  # noqa: E402
from surgery_client import Surgeon, Unanswered  # noqa: E402

SCENE = os.path.join(HERE, 'scenes', 'boxes_at_30.yaml')


class ClientTest(unittest.TestCase):

    def test_simulated_time_passes_as_asked_whatever_the_step_rate(self):
        with OwnNode(scene=SCENE, paused=True) as node:
            surgeon = Surgeon(node.name)
            surgeon.stepped()
            before = surgeon.state().sim_time
            surgeon.live(2.0)
            self.assertAlmostEqual(before + 2.0, surgeon.state().sim_time)
            self.assertEqual(60, surgeon.state().step)

    def test_what_runs_there_is_said_to_who_comes_late_and_when_it_changes(self):
        with OwnNode(scene=SCENE, world_frame='table') as node:
            node.good('pause', data=True)
            info = Surgeon(node.name).info()
            self.assertEqual(('table', 'table', SCENE, 30.0), (info.header.frame_id, info.world_frame, os.path.realpath(info.scene),
                                                               info.step_rate))
            self.assertRegex(info.version, r'^\d+\.\d+\.\d+$')
            self.assertEqual(['left', 'right'], [body.name for body in info.bodies])
            for body in info.bodies:
                self.assertGreater(body.particles, 100)
                self.assertTrue(0.002 < body.spacing < 0.05, body.spacing)
                self.assertEqual((0.0, 1, 1.0), (body.held, body.substeps_needed, body.stiffness_factor))
            heard = Recorder(node.name + '/info', Info)
            heard.wait()
            node.good('step', steps=30)  # nothing of it changes
            node.good('remove', name='left')
            heard.wait(lambda i: [body.name for body in i.bodies] == ['right'])
            self.assertEqual(2, heard.count())
            heard.close()

    def test_a_request_without_an_answer_is_sent_once(self):
        asked = []

        def broken(request):
            asked.append(request)
            raise RuntimeError('the connection breaks')
        service = rospy.Service('/broken/cut', Cut, broken)
        with self.assertRaises(Unanswered) as raised:
            Surgeon('/broken', timeout=1.0).cut((0, 0, 0), (1, 0, 0), (0, 0, 1))
        self.assertEqual(1, len(asked))
        self.assertIn('does not answer', str(raised.exception))
        service.shutdown()

    def test_a_node_that_was_started_again_is_found(self):
        with OwnNode(scene=SCENE, paused=True) as node:
            surgeon = Surgeon(node.name)
            surgeon.step(5)
            node.end(9)
            OwnNode.count -= 1  # of the same name
            with OwnNode(scene=SCENE, paused=True) as again:
                self.assertEqual(node.name, again.name)
                surgeon.step(2)
                self.assertEqual(2, surgeon.state().step)
                # One that died while it was asked says how things are.
                again.end(9)
                surgeon.timeout = 1.0
                with self.assertRaises((Unanswered, rospy.ROSException)):
                    surgeon.step(1)


if __name__ == '__main__':
    run('client', ClientTest)
