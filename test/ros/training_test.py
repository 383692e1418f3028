#!/usr/bin/env python3
"""Tasks on the running node: begun, watched, stopped and reported; and the report of its log has the same values to the bit."""
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import unittest

import numpy
import roslib.packages
import rospy
from geometry_msgs.msg import Point, Vector3

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import LONG, OwnNode, pose_stamped, run  # noqa: E402
from meshless_surgery.errors import Refused  # noqa: E402
from meshless_surgery.goals import Goals  # noqa: E402
from meshless_surgery.msg import TaskState  # noqa: E402
from shape_msgs.msg import SolidPrimitive  # noqa: E402
from visualization_msgs.msg import MarkerArray  # noqa: E402

REPORT = roslib.packages.find_node('meshless_surgery', 'report')[0]


def report_of(folder):
    with open(os.path.join(folder, 'report.json'), encoding='utf-8') as file:
        return json.load(file)


class TrainingTest(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp()

    def node(self, **parameters):
        return OwnNode(paused=True, session_directory=self.folder, **parameters)

    def palpate(self, node):
        """Presses above the lump and marks the place, as config/tasks/palpate.yaml wants it."""
        node.good('push', enable=True, radius=0.01, pose=pose_stamped(0.015, 0.010, 0.075))
        node.good('step', steps=60)
        node.good('push', enable=True, radius=0.01, speed=0.02, pose=pose_stamped(0.015, 0.010, 0.065))
        node.good('step', steps=240)
        node.good('push', enable=False)
        node.good('pick', point=Point(0.015, 0.010, 0.1), direction=Vector3(0, 0, -1))
        node.good('step', steps=120)

    def test_a_task_is_begun_done_and_reported_and_its_log_says_the_same(self):
        with self.node(scene='lump', command_log='log') as node:
            for service in ('stop_task', 'report'):
                self.assertFalse(node.call(service).success, service)
            for task, said in (('none', 'palpate'), ('retract', 'lump'), ('/etc/hostname', 'outside'), ('', 'name')):
                refused = node.call('start_task', task=task)
                self.assertFalse(refused.success, task)
                self.assertIn(said, refused.message)
            node.good('step', steps=50)
            node.good('pick', point=Point(0.0, 0.0, 0.1), direction=Vector3(0, 0, -1))  # is not of the task
            before = time.strftime('%Y-%m-%dT%H:%M:%S', time.gmtime())
            node.good('start_task', task='palpate', trainee='Ann B')
            self.palpate(node)
            answer = node.good('report')
            self.assertTrue(answer.passed, answer.message)
            self.assertEqual(os.path.join(self.folder, 'reports', 'Ann_B_palpate_1'), answer.folder)
            self.assertEqual(['report.csv', 'report.html', 'report.json'], sorted(os.listdir(answer.folder)))
            self.assertEqual(answer.folder, node.good('report').folder)  # of the same run
            self.assertEqual('log', report_of(answer.folder)['log'])  # its file, not its trainee or its folder
            with open(os.path.join(answer.folder, 'report.html'), encoding='utf-8') as page:
                self.assertIn('Log: log.', page.read())
            node.good('start_task', task='palpate', trainee='Ann B')
            node.good('step', steps=1)
            again = node.good('report')
            self.assertTrue(again.folder.endswith('Ann_B_palpate_2'))
            with open(os.path.join(again.folder, 'report.html'), encoding='utf-8') as page:
                self.assertIn('Ann_B_palpate_1', page.read())  # an earlier one
            self.assertFalse(node.call('report', name='../x').success)
        done = self.report_of_log('--trainee', 'Ann B')
        self.assertEqual(1, done.returncode, done.stdout)  # the last run has done nothing
        self.assertIn('run 2 of 2', done.stdout)
        live, replayed = report_of(answer.folder), report_of(os.path.join(self.folder, 'log.run1.report'))
        self.assertTrue(replayed['passed'])
        self.assertLess(before, live['date'])
        self.assertRegex(live['date'], r'^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z$')
        self.assertIsNone(replayed['date'])
        self.assertIn('no date', done.stdout)
        for report in (live, replayed):
            del report['log'], report['date']
        self.assertEqual(live, replayed)  # all digits
        self.assertEqual(2, self.report_of_log('--date', 'yesterday').returncode)
        self.assertEqual(1, self.report_of_log('--date', '2026-03-01T14:05:09Z').returncode)
        self.assertEqual('2026-03-01T14:05:09.000Z', report_of(os.path.join(self.folder, 'log.report'))['date'])

    def test_what_no_hand_does_is_refused_while_a_task_runs(self):
        from std_srvs.srv import SetBool
        with self.node(scene='blocks') as node:
            def tries(allowed):
                calls = {'undo': ('undo_cut', {}), 'remove': ('remove', dict(name='block')),
                         'attach': ('attach', dict(body='block', other='world', stiffness=1e4)), 'detach': ('detach', dict(name='block-world')),
                         'material': ('set_material', dict(yaml='{damping: 10}')), 'load': ('load', dict(file='state')),
                         'set_gravity': ('set_gravity', dict(gravity=Vector3(0, 0, -9))),
                         'set_pose': ('set_pose', dict(name='block', pose=pose_stamped(0, 0, 1))),
                         'reset_bodies': ('reset_bodies', dict(bodies=['block'])),
                         'apply_force': ('apply_force', dict(name='block', force=Vector3(0, 0, 0.1), time=0.1)),
                         'spawn': ('spawn', dict(name='guest', primitive=SolidPrimitive(type=SolidPrimitive.SPHERE, dimensions=[0.05]),
                                                 pose=pose_stamped(0, 0, 2)))}
                self.assertEqual(set(calls) | {'pause'}, set(words))
                for word in ('attach', 'detach', 'material', 'set_gravity', 'set_pose', 'apply_force', 'reset_bodies', 'spawn', 'remove', 'undo',
                             'load'):
                    service, fields = calls[word]
                    answer = node.call(service, **fields)
                    refused = 'does not allow ' + word in answer.message
                    self.assertEqual(word not in allowed, refused, (word, answer.message))
                    if refused:
                        self.assertIn('stop_task', answer.message)
                pause = rospy.ServiceProxy(node.name + '/pause', SetBool)
                node.call('pause', data=False)
                answer = pause(True)
                self.assertEqual('pause' in allowed, answer.success, answer.message)
            words = ['undo', 'remove', 'attach', 'detach', 'material', 'load', 'pause', 'set_gravity', 'set_pose', 'reset_bodies', 'apply_force',
                     'spawn']
            node.good('save', file='state')
            node.good('start_task', task='hand_over', trainee='Eve')
            block = node.good('get_body', name='block').surface.vertices[0]
            node.good('step', steps=1)
            node.good('pick', point=Point(block.x, block.y, block.z), max_distance=0.02)  # a hand has done something
            node.good('step', steps=1)
            tries(())
            with self.assertRaisesRegex(Refused, 'does not allow spawn'):
                Goals(node.name, LONG).send('spawn', dict(name='guest')).result(LONG)
            self.assertFalse(node.call('start_task', task='hand_over', allow=['everything']).success)
            node.good('start_task', task='hand_over', allow=words)
            time.sleep(0.1)
            tries(words)
            self.assertEqual(set(words), set(node.good('observe').task.allowed))
            node.good('stop_task')
            self.assertNotIn('does not allow', node.call('undo_cut').message)

    def test_each_run_that_somebody_has_watched_has_a_report_however_it_ends(self):
        reports, task = os.path.join(self.folder, 'reports'), os.path.join(self.folder, 'own.yaml')
        with open(task, 'w') as file:
            file.write('scene: blocks\nstages: [{hold: {body: block}, hold_for: 0.1}, {let_go: all, hold_for: 0.1}]\n')
        with OwnNode(scene='blocks', session_directory=self.folder, command_log='log', data_folders=self.folder) as node:

            def begin():
                node.good('start_task', task=task, trainee='Ann')

            def pick():
                at = node.good('get_body', name='block').surface.vertices[0]
                node.good('pick', point=Point(at.x, at.y, at.z), max_distance=0.05)
                time.sleep(0.3)

            def wait_for(number):
                end = time.monotonic() + LONG
                path = os.path.join(reports, 'Ann_own_%d' % number)
                while not os.path.isfile(os.path.join(path, 'report.html')):
                    self.assertLess(time.monotonic(), end, os.listdir(self.folder))
                    time.sleep(0.05)
                time.sleep(0.3)
                return report_of(path)
            begin()
            time.sleep(0.3)
            begin()  # nothing was done in the first: no report
            pick()
            node.good('reset')
            self.assertEqual('unfinished', wait_for(1)['outcome'])
            pick()
            node.good('stop_task')
            stopped = wait_for(2)
            self.assertGreater([m['value'] for m in stopped['metrics'] if m['name'] == 'wall_time'][0], 0.2)
            self.assertEqual(os.path.join(reports, 'Ann_own_2'), node.good('report').folder)
            begin()
            pick()
            node.good('clear_picks')
            self.assertEqual('done', wait_for(3)['outcome'])
            begin()
            pick()
        self.assertEqual('unfinished', wait_for(4)['outcome'])  # the node has ended
        self.assertEqual(4, len(os.listdir(reports)))
        done = subprocess.run([REPORT, os.path.join(self.folder, 'log'), '--task', task, '--out', self.folder],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=LONG, text=True)
        found = [report_of(os.path.join(self.folder, name)) for name in sorted(os.listdir(self.folder)) if name.endswith('.report')]
        dates = [report['date'] for report in found]
        for number in range(1, 5):
            live = report_of(os.path.join(reports, 'Ann_own_%d' % number))
            same = found[dates.index(live['date'])]
            for report in (live, same):
                for key in ('log', 'trainee', 'outcome'):
                    report.pop(key)
            self.assertEqual(live, same)

    def test_the_log_knows_tasks_whose_they_are_what_they_allow_and_where_they_were_stopped(self):
        def does(node, **fields):
            node.good('start_task', task='hand_over', **fields)
            block = node.good('get_body', name='block').surface.vertices[0]
            node.good('step', steps=1)
            node.good('pick', point=Point(block.x, block.y, block.z), max_distance=0.02)
            node.good('step', steps=5)
        with self.node(scene='blocks', command_log='log') as node:
            node.good('step', steps=3)  # of no task
            does(node, trainee='Eve', allow=['material'])
            node.good('set_material', yaml='{damping: 10}')
            node.good('step', steps=5)
            node.good('stop_task')
            node.good('remove', name='block')  # after it
            node.good('step', steps=5)
            live = report_of(node.good('report').folder)
            node.good('reset')  # and that is no run
            node.good('step', steps=5)
            does(node, trainee='Bob')
        self.assertEqual([], live['not_counted'])
        done = subprocess.run([REPORT, os.path.join(self.folder, 'log'), '--out', self.folder], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                              timeout=LONG, text=True)
        self.assertEqual(1, done.returncode, done.stdout)
        replayed = report_of(os.path.join(self.folder, 'log.run1.report'))
        self.assertEqual(('Eve', 'Bob'), (replayed['trainee'], report_of(os.path.join(self.folder, 'log.report'))['trainee']))
        for report in (live, replayed):
            for key in ('log', 'date', 'outcome'):
                report.pop(key)
        self.assertEqual(live, replayed)

    def report_of_log(self, *arguments):
        return subprocess.run([REPORT, os.path.join(self.folder, 'log'), '--task', 'palpate', '--out', self.folder] + list(arguments),
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=LONG, text=True)

    def test_names_keep_the_letters_of_their_alphabet(self):
        with self.node(scene='block', data_folders=self.folder) as node:
            for trainee, name in (('李雷', '李雷'), ('韩梅', '韩梅'), ('Zoë Ångström', 'Zoë_Ångström'), ('Иван', 'Иван'), ('ä' * 50, 'ä' * 50)):
                node.good('start_task', task=self.task_of('block'), trainee=trainee)
                node.good('step', steps=1)
                folder = node.good('report').folder
                self.assertEqual(name + '_own_1', os.path.basename(folder))
                self.assertEqual(trainee, report_of(folder)['trainee'])
            self.assertFalse(node.call('start_task', task=self.task_of('block'), trainee='ä' * 51).success)

    def task_of(self, scene):
        path = os.path.join(self.folder, 'own.yaml')
        with open(path, 'w') as file:
            file.write('scene: %s\nstages: [{let_go: all, hold_for: 1}]\n' % scene)
        return path

    def test_the_task_of_the_parameter_brings_its_scene_and_can_be_stopped(self):
        with self.node(task='retract', trainee='Bob') as node:
            task = rospy.wait_for_message(node.name + '/task', TaskState, LONG)
            self.assertEqual(('retract', 'Bob', ['hold', 'let go']), (task.task, task.trainee, task.stages))
            node.good('step', steps=10)
            node.good('stop_task')
            node.good('step', steps=10)
            report = report_of(node.good('report', name='mine').folder)
            self.assertEqual('unfinished', report['outcome'])
            self.assertEqual(10, report['last_step'])
            self.assertFalse(node.call('stop_task').success)

    def test_a_task_of_ones_own_has_its_meshes_and_picture_where_one_keeps_them(self):
        package = os.path.join(self.folder, 'trainer')
        for folder in ('tasks', 'scenes', 'meshes'):
            os.makedirs(os.path.join(package, folder))
        mesh = os.path.join(package, 'meshes', 'organ.obj')
        shutil.copy(os.path.join(roslib.packages.get_pkg_dir('meshless_surgery'), 'config', 'meshes', 'block.obj'), mesh)
        with open(os.path.join(package, 'scenes', 'own.yaml'), 'w') as file:
            file.write('bodies: [{name: organ, file: ../meshes/organ.obj, pose: {position: [0, 0, 0.1]}}]')
        with open(os.path.join(package, 'tasks', 'hint.png'), 'wb') as file:
            file.write(b'\x89PNG\r\n\x1a\n')
        task = os.path.join(package, 'tasks', 'own.yaml')
        with open(task, 'w') as file:
            file.write('scene: ../scenes/own.yaml\npicture: hint.png\n'
                       'stages: [{hold: {body: organ}}]\n')
        with self.node(task=task, data_folders=[os.path.join(package, 'meshes')], command_log='own') as node:
            organ = node.good('get_body', name='organ')
            at = organ.surface.vertices[0]
            node.good('pick', point=Point(at.x, at.y, at.z))
            node.good('step', steps=2)
            self.assertTrue(node.good('report').passed)
        os.remove(mesh)  # the log has it
        done = subprocess.run([REPORT, os.path.join(self.folder, 'own'), '--task', task, '--out', self.folder],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, timeout=LONG, text=True)
        self.assertEqual(0, done.returncode, done.stdout)

    def test_the_task_of_the_parameter_may_be_of_a_package(self):
        with self.node(task='package://meshless_surgery/config/tasks/retract.yaml') as node:
            self.assertEqual('retract', rospy.wait_for_message(node.name + '/task', TaskState, LONG).task)

    def test_plan_target_and_tray_are_shown(self):
        with self.node(task='resect') as node:
            node.good('step', steps=1)
            shown = self.markers(node)
            self.assertEqual({'plan', 'target', 'tray'}, set(shown))
            self.assertAlmostEqual(-0.068, shown['target'].pose.position.x, delta=1e-4)
            self.assertAlmostEqual(0.024, shown['target'].scale.x)
            self.assertAlmostEqual(-0.29, shown['tray'].pose.position.x)
            for p in shown['plan'].points:
                self.assertAlmostEqual(-0.016, 0.5 * p.x + 0.75 ** 0.5 * p.y, delta=1e-4)  # in its plane
            self.assertLess(self.off_the_surface(node, shown['plan'], 'liver'), 1e-4)
            # The organ sags, and they go with it.
            node.good('step', steps=120)
            end = time.monotonic() + LONG
            later = self.markers(node)  # those from before come first
            while later['target'].pose.position.z > shown['target'].pose.position.z - 0.002:
                self.assertLess(time.monotonic(), end, later['target'].pose.position)
                later = self.markers(node)
            self.assertLess(self.off_the_surface(node, later['plan'], 'liver'), 5e-4)
            self.assertGreater(max(abs(a.z - b.z) for a, b in zip(later['plan'].points, shown['plan'].points)), 0.002)
            seen = node.good('observe')
            self.assertEqual(later['plan'].points, seen.plan)
            self.assertEqual(later['target'].pose.position, seen.target)
            self.assertEqual(0.0, seen.task.plan_done)

    def off_the_surface(self, node, marker, body):
        """[m] the farthest that a point of the marker is from a body's surface."""
        mesh = node.good('get_body', name=body).surface
        corners = numpy.array([[(mesh.vertices[i].x, mesh.vertices[i].y, mesh.vertices[i].z) for i in t.vertex_indices] for t in mesh.triangles])
        a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        shares = numpy.array([(i / 6, j / 6) for i in range(7) for j in range(7 - i)])
        near = a[:, None] + shares[:, :1] * ab[:, None] + shares[:, 1:] * ac[:, None]  # points of each triangle
        normals = numpy.cross(ab, ac)
        normals /= numpy.linalg.norm(normals, axis=1)[:, None]
        most = 0.0
        for p in marker.points:
            away = near - (p.x, p.y, p.z)
            nearest = (away ** 2).sum(2).min(1).argsort()[:8]
            most = max(most, min(abs(away[t, 0] @ normals[t]) for t in nearest))
        return most

    def test_a_cut_along_the_drawn_line_is_on_the_plan(self):
        with self.node(task='incise') as node:
            node.good('step', steps=240)
            plan, before = self.markers(node)['plan'].points, None
            end = time.monotonic() + LONG
            while plan != before or min(p.z for p in plan if abs(p.x) < 0.038 and p.z > 0.05) > 0.055:  # the skin sags
                self.assertLess(time.monotonic(), end, plan)
                plan, before = self.markers(node)['plan'].points, plan
            ends = [p for p in plan if abs(p.x) > max(abs(q.x) for q in plan) - 0.001]  # the tops of its edges in the depth
            left = max((p for p in ends if p.x < 0.0), key=lambda p: p.z)
            right = max((p for p in ends if p.x > 0.0), key=lambda p: p.z)
            lowest = min(p.z for p in plan if abs(p.x) < 0.038 and p.z > 0.05)
            blade = pose_stamped(left.x, left.y, left.z + 0.001, (0.5 ** 0.5, 0.0, 0.0, 0.5 ** 0.5))  # its y is up
            node.good('incise', blade=blade, length=right.x - left.x, depth=left.z + 0.001 - lowest + 0.013)
            node.good('step', steps=60)
            task = node.good('observe').task
            self.assertTrue(task.passed, node.good('observe'))
            self.assertGreater(task.plan_done, 0.9)

    def markers(self, node):
        heard = []
        topic = rospy.Subscriber(node.name + '/task_markers', MarkerArray, lambda array: heard.append(
            {marker.ns: marker for marker in array.markers if marker.ns}))
        end = time.monotonic() + LONG
        while not (heard and 'plan' in heard[-1]):  # once the first step has been
            self.assertLess(time.monotonic(), end, heard)
            time.sleep(0.05)
        topic.unregister()
        return heard[-1]

    def test_a_task_that_cannot_be_read_ends_the_node(self):
        node = self.node(task='retrakt')
        self.assertEqual(1, node.process.wait(LONG))
        self.assertIn('retract', node.output())
        node.__exit__()


if __name__ == '__main__':
    run('training', TrainingTest)
