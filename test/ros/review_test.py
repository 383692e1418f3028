#!/usr/bin/env python3
"""A logged session is looked back at: any moment is what it was, whoever asks and in whatever order."""
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

import meshless_surgery.msg
import meshless_surgery.srv
import roslib.packages
import rospy
from geometry_msgs.msg import Point
from meshless_surgery.msg import Bookmarks, ContactForces, Info, Review, State, Surfaces, Topology, Vertices
from meshless_surgery.srv import Hash, Play, Seek
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import ACROSS_X, LONG, OF_REVIEW, OwnNode, Recorder, launched, pose_stamped, run  # noqa: E402

SCENES = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes')
BOXES = os.path.join(SCENES, 'boxes.yaml')


def read(path):
    with open(path, 'rb') as file:
        return file.read()


def write(path, contents):
    with open(path, 'wb') as file:
        file.write(contents)


class ReviewNode:
    """A review_node of this test; `refused` waits for its end instead."""

    count = 0

    def __init__(self, **parameters):
        ReviewNode.count += 1
        self.name = '/own_review_%d' % ReviewNode.count
        for key, value in parameters.items():
            rospy.set_param('%s/%s' % (self.name, key), value)
        binary = roslib.packages.find_node('meshless_surgery', 'review_node')[0]
        self.log = tempfile.TemporaryFile(mode='w+', errors='replace')
        self.process = subprocess.Popen([binary, '__name:=' + self.name[1:]], stdout=self.log, stderr=self.log)

    def output(self):
        number = self.log.fileno()
        return os.pread(number, os.fstat(number).st_size, 0).decode(errors='replace')

    def call(self, service, kind, **fields):
        name = self.name + '/' + service
        end = time.monotonic() + LONG
        while True:
            if self.process.poll() is not None:
                raise AssertionError('the node has ended: ' + self.output())
            try:
                rospy.wait_for_service(name, 0.5)
                return rospy.ServiceProxy(name, kind)(**fields)
            except rospy.ROSException:
                if time.monotonic() > end:
                    raise

    def hash(self):
        answer = self.call('hash', Hash)
        assert answer.success, answer.message
        return answer.hash

    def seek(self, when):
        answer = self.call('seek', Seek, time=when)
        assert answer.success, answer.message
        return answer

    def recorder(self, topic, kind):
        return Recorder(self.name + '/' + topic, kind)

    def __enter__(self):
        return self

    def __exit__(self, *failure):
        if self.process.poll() is None:
            self.process.send_signal(15)
        self.code = self.process.wait(LONG)
        self.log.close()


class ReviewTest(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        """A session of some seconds: picked, cut, undone, cut again, pushed. Of some of its moments the hash is known."""
        cls.folder = tempfile.mkdtemp(prefix='meshless_review_')
        cls.known = {}  # steps since the start: hash
        with OwnNode(scene=BOXES, session_directory=cls.folder, command_log='monday', paused=True) as node:
            steps = 0

            def go(count):
                nonlocal steps
                node.good('step', steps=count)
                steps += count
                cls.known[steps] = node.hash()

            go(60)
            pick = node.good('pick', point=Point(-0.2, 0.0, 0.15), max_distance=0.1)
            for k in range(30):
                node.good('move_pick', pick_id=pick.pick_id, target=Point(-0.2, 0.01 * k, 0.15))
                go(4)
            cut = node.good('cut', blades=pose_stamped(0.2, -1.0, 0.1, ACROSS_X), bodies=['right'])
            assert cut.new_bodies
            go(30)
            node.good('undo_cut')
            go(30)
            node.good('cut', blades=pose_stamped(0.22, -1.0, 0.1, ACROSS_X), bodies=['right'])
            go(60)
            node.good('release', pick_id=pick.pick_id)
            go(60)
            node.good('reset')
            go(60)
            cls.length = steps

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder, ignore_errors=True)

    def rate(self):
        return 120.0

    def look_everywhere(self, review):
        moments = list(self.known)
        random.Random(3).shuffle(moments)
        for steps in moments:
            review.seek(steps / self.rate())
            self.assertEqual(self.known[steps], review.hash(), 'after %d steps' % steps)

    def test_who_comes_late_gets_all_while_it_stands_still(self):
        topics = {'surfaces': Surfaces, 'strained_surfaces': Surfaces, 'vertices': Vertices, 'markers': MarkerArray, 'points': PointCloud2,
                  'clusters': MarkerArray, 'collision_surfaces': MarkerArray, 'contacts': MarkerArray, 'contact_forces': ContactForces, 'topology': Topology,
                  'info': Info, 'state': State, 'review': Review}
        with ReviewNode(session_directory=self.folder, log='monday') as review:
            for _ in range(2):  # a display that is switched off and on
                for topic, kind in topics.items():
                    recorder = review.recorder(topic, kind)
                    recorder.wait()
                    recorder.close()

    def test_the_hash_says_of_which_step_and_time_it_is(self):
        with ReviewNode(session_directory=self.folder, log='monday') as review:
            for steps in (60, 180):  # before the reset
                review.seek(steps / self.rate())
                answer = review.call('hash', Hash)
                self.assertEqual((True, steps, self.known[steps], 0), (answer.success, answer.step, answer.hash, answer.error_code))
                self.assertAlmostEqual(steps / self.rate(), answer.sim_time)
                self.assertIn(str(steps), answer.message)

    def test_any_moment_is_what_it_was(self):
        with ReviewNode(session_directory=self.folder, log='monday') as review:
            self.look_everywhere(review)
            self.assertNotIn('is made now', review.output())

    def test_without_an_index_one_is_made(self):
        other = tempfile.mkdtemp(prefix='meshless_review_')
        self.addCleanup(shutil.rmtree, other, True)
        path = os.path.join(other, 'copied')
        shutil.copy(os.path.join(self.folder, 'monday'), path)
        with ReviewNode(log=path) as review:
            self.look_everywhere(review)
            self.assertIn('one is made now', review.output())
        # Of another log: not used. The next one finds what was made.
        with ReviewNode(log=path) as review:
            self.look_everywhere(review)
            self.assertNotIn('one is made now', review.output())
        with open(path + '.index', 'r+b') as index:
            index.seek(13)
            index.write(b'other!')
        with ReviewNode(log=path) as review:
            self.look_everywhere(review)
            self.assertIn('of another log', review.output())

    def copied(self):
        """A log with its index that may be damaged."""
        other = tempfile.mkdtemp(prefix='meshless_review_')
        self.addCleanup(shutil.rmtree, other, True)
        for name in ('monday', 'monday.index'):
            shutil.copy(os.path.join(self.folder, name), other)
        return os.path.join(other, 'monday')

    def test_a_damaged_index_is_made_anew(self):
        path = self.copied()
        whole = read(path + '.index')
        turned = bytearray(whole)
        turned[len(turned) // 2] ^= 4
        for damaged, words in ((bytes(turned), 'checksum is wrong'), (whole[:len(whole) // 2], 'breaks off'),
                               (whole + bytes(4096), 'claims 0 bytes'), (b'', 'does not begin with')):
            write(path + '.index', damaged)
            with ReviewNode(log=path) as review:
                self.look_everywhere(review)
                self.assertIn('one is made now', review.output())
                self.assertIn(words, review.output())
                marks = review.recorder('bookmarks', Bookmarks).wait()
                self.assertTrue(any('cut' in text for text in marks.texts), marks.texts)
            with ReviewNode(log=path) as review:
                review.seek(0.5)
                self.assertNotIn('one is made now', review.output())

    def test_a_damaged_log_is_shown_up_to_there(self):
        path = self.copied()
        whole = read(path)
        turned = bytearray(whole)
        turned[-1] ^= 1  # of the last record, which tells that it ends
        for damaged in (whole + bytes(4096), bytes(turned), whole[:-1]):
            write(path, damaged)
            with ReviewNode(log=path) as review:
                length = review.recorder('review', Review).wait().length
                for steps in [steps for steps in self.known if steps <= length * self.rate()]:
                    review.seek(steps / self.rate())
                    self.assertEqual(self.known[steps], review.hash(), 'after %d steps' % steps)
                self.assertIn('the log breaks off at record', review.output())
                self.assertNotIn('one is made now', review.output())
                marks = review.recorder('bookmarks', Bookmarks).wait()
                self.assertIn('the log breaks off at record', marks.texts[-1])
                self.assertTrue(marks.errors[-1])
                self.assertAlmostEqual(length, marks.times[-1])
        self.assertGreater(length, 0.5 * self.length / self.rate())

    def test_programs_replay_what_is_whole_of_a_damaged_log(self):
        path = self.copied()
        turned = bytearray(read(path))
        turned[-1] ^= 1
        write(path, bytes(turned))
        task = os.path.join(os.path.dirname(path), 'task.yaml')
        write(task, b'scene: boxes\nstages: [{let_go: all}]\n')
        for program, words in (('replay', 'hashes compared'), ('report', 'the report is of what there is')):
            told = subprocess.run([roslib.packages.find_node('meshless_surgery', program)[0], path] +
                                  (['--task', task, '--out', os.path.dirname(path)] if program == 'report' else []),
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True, timeout=LONG, check=False)
            self.assertIn(told.returncode, (0, 1), told.stdout)
            self.assertIn('the log breaks off at record', told.stdout)
            self.assertIn(words, told.stdout)
        with open(path + '.report/report.json', encoding='utf-8') as report:
            self.assertIn('breaks off', json.load(report)['lost'])

    def test_it_plays_stands_still_and_ends(self):
        with ReviewNode(session_directory=self.folder, log='monday') as review:
            review.seek(0.0)
            told = review.recorder('review', Review)
            first = told.wait(lambda now: now.speed == 0.0)
            self.assertEqual('monday', first.log)
            self.assertAlmostEqual(self.length / self.rate(), first.length, 6)
            self.assertTrue(review.call('play', Play, speed=4.0).success)
            told.wait(lambda now: now.speed == 4.0 and now.time > 0.5)
            self.assertTrue(review.call('play', Play, speed=0.0).success)
            still = told.wait(lambda now: now.speed == 0.0, since=told.count() - 1) if told.count() else None
            self.assertIsNotNone(still)
            self.assertTrue(review.call('play', Play, speed=100.0).success)
            end = told.wait(lambda now: now.speed == 0.0 and now.time == now.length)
            self.assertEqual(self.known[self.length], review.hash())
            # Once more, from the start.
            since = told.count()
            self.assertTrue(review.call('play', Play, speed=1.0).success)
            told.wait(lambda now: now.speed == 1.0 and now.time < 0.5 * end.length, since=since)

    def test_bodies_paths_and_bookmarks_are_shown(self):
        with ReviewNode(session_directory=self.folder, log='monday') as review:
            review.seek(0.5)
            surfaces = review.recorder('surfaces', Surfaces)
            before = surfaces.wait()
            after = review.seek((60 + 120 + 30) / self.rate())
            self.assertLess(len(before.bodies), len(surfaces.wait(lambda seen: len(seen.bodies) > len(before.bodies)).bodies),
                            after.message)
            marks = review.recorder('bookmarks', Bookmarks).wait()
            self.assertEqual(len(marks.times), len(marks.errors))
            cuts = [k for k, text in enumerate(marks.texts) if 'cut' in text]
            self.assertTrue(cuts)
            undone = [k for k, error in enumerate(marks.errors) if error]
            self.assertTrue(undone, marks.texts)
            self.assertTrue(any(abs(marks.times[k] - (60 + 120 + 30 + 1) / self.rate()) < 0.02 for k in undone), marks)
            paths = review.recorder('hand_paths', MarkerArray).wait().markers
            points = [p for path in paths if path.ns == 'pick' for p in path.points]
            self.assertGreater(max(p.y for p in points), 0.2)
            self.assertEqual(len(points), sum(len(path.colors) for path in paths if path.ns == 'pick'))

    def test_rviz_shows_the_nodes_that_are_launched_and_no_others(self):
        for given, nodes in (((), {'/review'}), (('other:=tuesday',), {'/review', '/review_other'})):
            rviz = launched('review.launch', 'log:=monday', *given)
            self.assertEqual(nodes, {name for name in rviz if name.startswith('/review')})
            with open(rviz['/rviz'][rviz['/rviz'].index('-d') + 1]) as view:
                named = re.findall(r'(?:Node|Nodes|Topic): (/.*)', view.read())
            self.assertEqual(nodes, {re.match('/[a-z_]+', name).group() for names in named for name in names.split()
                                     if name != '/clicked_point'})

    def test_rviz_looks_from_a_frame_without_a_slash(self):
        # tf1 had one; rviz does not find it.
        for file, given in (('review.launch', ('log:=monday',)), ('training.launch', ('tf_prefix:=/left',))):
            nodes = launched(file, 'world_frame:=/table', *given)
            self.assertEqual(['-f', 'table'], nodes['/rviz'][-2:])
            self.assertEqual(['table', 'left/scene' if file == 'training.launch' else 'scene'], nodes['/scene_frame'][-2:])

    def test_each_field_has_a_law_here(self):
        known = {'Review': ['header', 'log', 'time', 'length', 'speed'], 'Bookmarks': ['header', 'times', 'texts', 'errors'],
                 'SeekRequest': ['time'], 'SeekResponse': ['success', 'message', 'time', 'took', 'error_code'],
                 'PlayRequest': ['speed'], 'PlayResponse': ['success', 'message', 'error_code']}
        for name in OF_REVIEW:
            kinds = [getattr(meshless_surgery.msg, name)] if hasattr(meshless_surgery.msg, name) else [
                getattr(meshless_surgery.srv, name + part) for part in ('Request', 'Response')]
            for kind in kinds:
                self.assertEqual(known[kind.__name__], kind.__slots__)
        with ReviewNode(session_directory=self.folder, log='monday') as review:
            answer = review.seek(0.5041)  # shows the step that is nearest
            self.assertEqual(60 / self.rate(), answer.time)
            self.assertEqual(self.known[60], review.hash())
            self.assertGreaterEqual(answer.took, 0.0)
        with ReviewNode(session_directory=self.folder, log='monday', world_frame='/table') as review:
            for topic, kind in (('review', Review), ('bookmarks', Bookmarks), ('surfaces', Surfaces)):
                self.assertEqual('table', review.recorder(topic, kind).wait().header.frame_id)
            self.assertEqual('table', review.recorder('info', Info).wait().world_frame)

    def test_what_cannot_be_is_refused(self):
        with ReviewNode(session_directory=self.folder, log='monday') as review:
            held = review.hash()
            for when in (-0.1, 1e9, float('nan')):
                answer = review.call('seek', Seek, time=when)
                self.assertFalse(answer.success)
                self.assertIn('accepted: 0 to ', answer.message)
            for speed in (-1.0, 1e3, float('nan')):
                answer = review.call('play', Play, speed=speed)
                self.assertFalse(answer.success)
                self.assertIn('accepted: 0 or 0.01 to 100', answer.message)
            self.assertEqual(held, review.hash())
        for parameters, words in ((dict(), 'parameter ~log is missing'),
                                  (dict(log='monday', world_frame=''), 'parameter ~world_frame'),
                                  (dict(log=[1.5]), 'parameter ~log is of the wrong type'),
                                  (dict(log='nowhere', session_directory=self.folder), 'there is no log'),
                                  (dict(log=BOXES), 'does not begin with')):
            with ReviewNode(**parameters) as refused:
                self.assertEqual(1, refused.process.wait(LONG))
                self.assertIn(words, refused.output())


if __name__ == '__main__':
    run('review', ReviewTest)
