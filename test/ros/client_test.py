#!/usr/bin/env python3
"""The Python client: it goes by what the node says of itself, and sends what changes something once."""
import math
import os
import subprocess
import sys
import tempfile
import unittest

import rosgraph
import rospy
import tf2_ros
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from meshless_surgery import ErrorCode, Refused, Surgeon, SurgeryError, Unanswered
from meshless_surgery.msg import Info
from meshless_surgery.poses import blades_pose
from meshless_surgery.srv import Cut

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, HERE)
from deformer_support import OwnNode, Recorder, run  # noqa: E402

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
                self.assertEqual((0.0, 1.0), (body.held, body.stiffness_factor))
                self.assertTrue(1 <= body.substeps_needed <= 64, body.substeps_needed)
            heard = Recorder(node.name + '/info', Info)
            heard.wait()
            node.good('step', steps=30)  # nothing of it changes
            node.good('remove', name='left')
            heard.wait(lambda i: [body.name for body in i.bodies] == ['right'])
            self.assertEqual(2, heard.count())
            heard.close()

    def test_a_world_that_somebody_else_has_paused_lives_by_steps_and_stays_paused(self):
        with OwnNode(scene=SCENE, paused=True) as node:
            surgeon = Surgeon(node.name)
            with surgeon.still():
                pass
            surgeon.live(0.5)
            state = surgeon.state()
            self.assertEqual((True, 15), (state.paused, state.step))

    def test_who_asks_a_node_that_is_not_there_hears_so_as_of_any_error(self):
        surgeon = Surgeon('/nowhere', timeout=0.2)
        for ask in (surgeon.state, surgeon.info, surgeon.reset, lambda: surgeon.stream('pick'), lambda: surgeon.live(1.0)):
            with self.assertRaises(SurgeryError) as raised:
                ask()
            self.assertIn('/nowhere', str(raised.exception))
            self.assertIsInstance(raised.exception, rospy.ROSException)

    def test_scripts_without_a_master_say_so_in_a_line(self):
        environment = dict(os.environ, ROS_MASTER_URI='http://127.0.0.1:1')
        scripts = os.path.join(os.path.dirname(os.path.dirname(HERE)), 'scripts')
        with tempfile.TemporaryDirectory() as folder:
            for words in (['play_block.py'], ['play_lump.py', '--node', '/other'], ['device.py'],
                          ['spawn_phantom.py', '--node', '/deformer', '--out', os.path.join(folder, 'x.bag')]):
                done = subprocess.run([sys.executable, '-B', os.path.join(scripts, words[0])] + words[1:], env=environment,
                                      stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, timeout=120)
                self.assertEqual(1, done.returncode, words)
                self.assertRegex(done.stderr, '^no master answers at ROS_MASTER_URI, which is http://127.0.0.1:1 .*\n$')
        done = subprocess.run([sys.executable, '-B', '-c', 'from meshless_surgery import Surgeon\nSurgeon(timeout=0.5).clear()'],
                              env=environment, stderr=subprocess.PIPE, text=True, timeout=120)
        self.assertIn('Unreachable: no master answers at ROS_MASTER_URI', done.stderr.splitlines()[-1])

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


class SurgeonTest(unittest.TestCase):
    """Every method once, on the world and not on what it was asked for."""

    @classmethod
    def setUpClass(cls):
        cls.session = tempfile.TemporaryDirectory()
        cls.running = OwnNode(scene=os.path.join(HERE, 'scenes', 'boxes.yaml'), paused=True, tools__silence=0.0,
                              session_directory=cls.session.name).wait()
        cls.surgeon = Surgeon(cls.running.name)

    @classmethod
    def tearDownClass(cls):
        cls.running.end()
        cls.running.__exit__()
        cls.session.cleanup()

    def setUp(self):
        self.surgeon.stepped()
        self.surgeon.reset()

    def bodies(self):
        return sorted(body.name for body in self.surgeon.state().bodies)

    def test_springs(self):
        pick = self.surgeon.pick((-0.15, 0, 0.1), max_distance=0.1)
        self.surgeon.move(pick.pick_id, (-0.1, 0.02, 0.1))
        self.assertAlmostEqual(0.02, self.surgeon.state().picks[0].target.y)
        self.surgeon.lock(pick.pick_id, (-0.1, 0.03, 0.1))
        self.assertTrue(self.surgeon.state().picks[0].locked)
        self.assertAlmostEqual(0.03, self.surgeon.state().picks[0].target.y)
        self.surgeon.release(pick.pick_id)
        self.assertEqual([], self.surgeon.state().picks)
        self.surgeon.pick((-1, 0, 0.1), direction=(1, 0, 0))
        self.surgeon.clear()
        self.assertEqual([], self.surgeon.state().picks)

    def test_probe_says_what_is_there_and_missed_where_nothing_is(self):
        met = self.surgeon.probe((-1, 0.01, 0.1), (1, 0, 0))
        self.assertEqual('left', met.body)
        self.assertAlmostEqual(-1.0, met.normal.x)
        with self.assertRaises(Refused) as refused:
            self.surgeon.probe((0, 0, 1), (0, 0, 1))
        self.assertEqual((ErrorCode.MISSED, 'probe'), (refused.exception.code, refused.exception.service))
        self.assertIsInstance(refused.exception, SurgeryError)

    def test_bodies_come_and_go(self):
        self.surgeon.spawn(name='ball', sphere=0.03, position=(0, 0, 1))
        self.surgeon.spawn(name='brick', box=(0.1, 0.1, 0.05), position=(0, 0, 2), scale=2.0, material='stiff')
        self.surgeon.spawn(name='rod', cylinder=(0.2, 0.02), position=(0, 0, 3))
        self.surgeon.spawn(file='tetrahedron.obj', position=(0, 0, 4))
        self.assertEqual(['ball', 'brick', 'left', 'right', 'rod', 'tetrahedron'], self.bodies())
        self.assertAlmostEqual(8 * 5e-4, self.surgeon.body('brick').volume)
        self.surgeon.remove('ball')
        self.assertNotIn('ball', self.bodies())
        self.surgeon.set_material('brick', '{density: 500}')
        for given in ({}, dict(box=(1, 1, 1), sphere=1.0), dict(file='x.obj', sphere=1.0)):
            with self.assertRaises(ValueError):
                self.surgeon.spawn(name='x', **given)

    def test_a_value_that_fits_no_field_is_not_sent_and_the_next_request_is_as_ever(self):
        for wrong in (lambda: self.surgeon.step(1.5), lambda: self.surgeon.set_material('left', {'density': 500}),
                      lambda: self.surgeon.remove(7)):
            with self.assertRaisesRegex(ValueError, 'was not sent'):
                wrong()
        self.surgeon.step(1)
        self.surgeon.set_material('left', '{density: 500}')
        with self.assertRaises(Refused):
            self.surgeon.remove('7')

    def test_what_is_no_point_and_no_time_is_not_sent_and_says_what_is_wanted(self):
        three = '; accepted: three numbers x, y, z$'
        surgeon = self.surgeon
        for said, wrong in (("^point is 'left'" + three, lambda: surgeon.pick('left')),
                            ('^gravity is 9.81' + three, lambda: surgeon.set_gravity(9.81)),
                            (r'^target is \(1, 2\)' + three, lambda: surgeon.lock(1, (1, 2))),
                            ('^position is None' + three, lambda: surgeon.push(None)),
                            (r'^points\[1\] is 7' + three, lambda: surgeon.tissue_load('left', [(0, 0, 0), 7])),
                            ("^reach is 'up'" + three, lambda: surgeon.cut((0, 0, 0), 'up', (0, 0, 1))),
                            ('^box is 0.1' + three, lambda: surgeon.spawn(box=0.1)),
                            (r'^turn is \(0, 0, 1\); accepted: four numbers', lambda: surgeon.move_clamp('left', turn=(0, 0, 1))),
                            ('^seconds is -1; accepted: a number, 0 or more$', lambda: surgeon.live(-1)),
                            ('^seconds is nan; accepted', lambda: surgeon.live(math.nan))):
            with self.assertRaisesRegex(ValueError, said):
                wrong()
        step = surgeon.state().step
        surgeon.live(0.05)
        self.assertEqual(step + 6, surgeon.state().step)

    def test_blades_without_a_plane_are_not_sent(self):
        for reach, normal in (((0, 1, 0), (0, 2, 0)), ((0, 0, 0), (1, 0, 0)), ((0, 1, 0), (0, 0, 0)), ((0, 1, 0), (math.nan, 0, 0))):
            with self.assertRaisesRegex(ValueError, 'accepted: two directions at an angle'):
                self.surgeon.cut(pivot=(-0.2, -1, 0.1), reach=reach, normal=normal)
        with self.assertRaisesRegex(ValueError, 'along is .* and out is .*; accepted: two directions at an angle'):
            self.surgeon.incise(start=(-0.2, 0, 0.2), along=(1, 0, 0), out=(-1, 0, 0), length=0.1, depth=0.1)

    def test_cuts_incisions_and_back(self):
        across = dict(pivot=(-0.2, -1, 0.1), reach=(0, 1, 0), normal=(1, 0, 0), bodies=['left'])
        pieces = self.surgeon.cut(**across).new_bodies
        self.assertEqual(sorted(pieces) + ['right'], self.bodies())
        self.surgeon.undo()
        self.assertEqual(['left', 'right'], self.bodies())
        with self.assertRaises(Refused) as refused:
            self.surgeon.cut(roughness=-0.5, **across)
        self.assertEqual(ErrorCode.INVALID_ARGUMENT, refused.exception.code)
        self.assertIn('roughness', refused.exception.message)
        opened = self.surgeon.incise(start=(0.17, 0.0, 0.15), along=(1, 0, 0), out=(0, 0, 1), length=0.06, depth=0.03,
                                     bodies=['right'])
        self.assertEqual(['right'], opened.cut_bodies)
        self.assertAlmostEqual(0.06 * 0.03, opened.opened_area, places=5)
        with self.assertRaises(Refused) as refused:
            self.surgeon.open_scissors()
        self.assertIsNone(refused.exception.code)
        self.surgeon.lift_scissors()

    def test_the_push_sphere(self):
        with self.surgeon.stream('push') as push, self.assertRaises(SurgeryError) as raised:
            push.timeout = 0.3
            while True:  # it may say once that it is gone
                push.measured()
        self.assertIn('push/measured_cp says nothing', str(raised.exception))
        self.surgeon.push((0, 0, 1), radius=0.02)
        with self.surgeon.stream('push') as push:
            self.assertAlmostEqual(1.0, push.measured().pose.position.z)
        self.surgeon.lift_push()

    def test_saved_and_loaded_it_is_the_same(self):
        self.surgeon.pick((-0.15, 0, 0.1), max_distance=0.1)
        self.surgeon.step(3)
        before = self.surgeon.hash()
        self.surgeon.save('here.state')
        self.surgeon.step(3)
        self.assertNotEqual(before, self.surgeon.hash())
        self.surgeon.load('here.state')
        self.assertEqual(before, self.surgeon.hash())

    def hears(self, topic):
        """Whether this process subscribes to it."""
        subscribers = dict(rosgraph.Master(rospy.get_name()).getSystemState()[1])
        return rospy.get_name() in subscribers.get(self.running.name + '/' + topic, [])

    def test_streams_move_tools_and_cut(self):
        self.surgeon.pick((-0.15, 0, 0.1), max_distance=0.1)
        with self.surgeon.stream('pick') as hand:
            while abs(self.surgeon.state().picks[0].target.y - 0.02) > 1e-6:
                hand.move((-0.15, 0.02, 0.1))
            self.assertAlmostEqual(0.02, hand.measured().pose.position.y)
            self.assertFalse(self.hears('pick/measured_cf'))
            stamps = [hand.force().header.stamp for _ in range(5)]
            self.assertEqual(sorted(set(stamps)), stamps)  # each is the next
            self.assertTrue(math.isfinite(hand.force().wrench.force.y))
            self.assertTrue(self.hears('pick/measured_cf'), 'it subscribes anew for each message')
            with self.assertRaises(ValueError):
                hand.jaw(0.1)
        self.assertFalse(self.hears('pick/measured_cf'))
        blades = blades_pose((-0.2, -0.05, 0.1), (0, 1, 0), (1, 0, 0)).pose.orientation
        with self.surgeon.stream('scissors') as scissors:
            angle = 0.5
            while len(self.bodies()) == 2:
                scissors.move((-0.2, -0.03, 0.1), (blades.x, blades.y, blades.z, blades.w))
                scissors.jaw(angle)
                angle = 0.5 - angle
        with self.assertRaises(ValueError):
            self.surgeon.stream('saw')

    def test_positions_are_in_the_surgeons_frame(self):
        broadcaster = tf2_ros.StaticTransformBroadcaster()
        table = TransformStamped(child_frame_id='table')
        table.header.frame_id = 'world'
        table.transform.translation = Vector3(0.2, 0, 0.1)
        half = math.sqrt(0.5)
        table.transform.rotation = Quaternion(0, 0, half, half)  # its x axis is the world's y
        broadcaster.sendTransform(table)
        at_table = Surgeon(self.running.name, frame='table')
        for _ in range(100):  # until the node has heard of it
            try:
                pick = at_table.pick((-1, 0.01, 0), direction=(1, 0, 0))
                break
            except Refused as refused:
                self.assertEqual(ErrorCode.UNKNOWN_NAME, refused.code)
        self.assertEqual('right', pick.body)
        self.assertAlmostEqual(0.19, pick.position.x, places=6)
        cut = at_table.cut(pivot=(0, 1, 0), reach=(0, -1, 0), normal=(1, 0, 0))
        self.assertEqual(['left', 'right'], sorted(cut.cut_bodies))
        self.surgeon.undo()
        at_table.lock(pick.pick_id, (0.1, 0, 0))
        self.assertAlmostEqual(0.1, self.surgeon.state().picks[0].target.y)
        at_table.move(pick.pick_id, (0.1, 0, 0), frame='world')
        self.assertAlmostEqual(0.1, self.surgeon.state().picks[0].target.x)

    def test_time_passes_by_steps_alone_until_it_runs(self):
        self.surgeon.step(5)
        self.assertEqual(5, self.surgeon.state().step)
        self.surgeon.runs()
        self.surgeon.live(0.1)
        with self.surgeon.still():
            self.assertTrue(self.surgeon.state().paused)
        self.assertFalse(self.surgeon.state().paused)


if __name__ == '__main__':
    run('client', ClientTest, SurgeonTest)
