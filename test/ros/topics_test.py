#!/usr/bin/env python3
"""Markers, state, events and diagnostics; and that nothing is built for nobody."""
import io
import os
import struct
import sys

import numpy
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Point
from meshless_surgery.msg import Event, Surfaces, Topology, Vertices
from meshless_surgery.surfaces import SurfaceReader
from shape_msgs.msg import SolidPrimitive
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import ACROSS_X, DeformerTestCase, OwnNode, Recorder, pose_stamped, run  # noqa: E402


def of(array, ns, action):
    return [m for m in array.markers if m.ns == ns and m.action == action]


def area_of(points):
    total = 0.0
    for a, b, c in zip(points[0::3], points[1::3], points[2::3]):
        u = (b.x - a.x, b.y - a.y, b.z - a.z)
        v = (c.x - a.x, c.y - a.y, c.z - a.z)
        n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
        area = 0.5 * sum(x * x for x in n) ** 0.5
        if area == 0.0:
            raise AssertionError('a triangle without an area')
        total += area
    return total


def is_shade_of(shade, color):
    """The same colour in another light."""
    a, b = (shade.r, shade.g, shade.b), (color.r, color.g, color.b)
    return all(abs(a[i] * b[j] - a[j] * b[i]) < 1e-4 for i in range(3) for j in range(i))


class MarkersTest(DeformerTestCase):

    def setUp(self):
        super().setUp()
        self.markers = self.deformer.recorder('markers', MarkerArray)

    def tearDown(self):
        self.markers.close()
        super().tearDown()

    def test_who_comes_late_gets_the_full_set_even_while_nothing_moves(self):
        self.markers.wait()
        self.markers.close()  # rospy would share its connection, and nobody would be late
        for _ in range(3):
            late = self.deformer.recorder('markers', MarkerArray)
            self.addCleanup(late.close)
            first = late.wait(lambda array: of(array, '', Marker.DELETEALL))
            bodies = of(first, 'bodies', Marker.ADD)
            self.assertEqual(2, len(bodies))
            for body in bodies:
                self.assertEqual(Marker.TRIANGLE_LIST, body.type)
                self.assertEqual('world', body.header.frame_id)
                self.assertAlmostEqual(0.06, area_of(body.points), places=6)
            late.close()

    def test_a_cut_deletes_the_parent_and_adds_the_pieces_with_their_inside(self):
        before = self.markers.wait(lambda array: len(of(array, 'bodies', Marker.ADD)) == 2)
        old = {m.id: m.color for m in of(before, 'bodies', Marker.ADD)}
        since = self.markers.count()
        answer = self.good('cut', blades=pose_stamped(-0.19, -1.0, 0.1, ACROSS_X))
        after = self.markers.wait(lambda array: of(array, 'bodies', Marker.DELETE), since)
        gone = of(after, 'bodies', Marker.DELETE)
        self.assertEqual(1, len(gone))
        self.assertIn(gone[0].id, old)
        now = of(after, 'bodies', Marker.ADD)
        self.assertEqual(3, len(now))
        pieces = [m for m in now if m.id not in old]
        self.assertEqual(2, len(pieces))
        for piece in pieces:
            self.assertEqual(old[gone[0].id], piece.color)
            self.assertEqual(len(piece.points), len(piece.colors))
            inside = [p for p, color in zip(piece.points, piece.colors) if not is_shade_of(color, piece.color)]
            self.assertAlmostEqual(answer.cap_area, area_of(inside), places=6)

    def test_a_reset_begins_with_delete_all(self):
        self.markers.wait(lambda array: len(of(array, 'bodies', Marker.ADD)) == 2)
        since = self.markers.count()
        self.good('reset')
        array = self.markers.wait(lambda array: of(array, '', Marker.DELETEALL), since)
        self.assertEqual(Marker.DELETEALL, array.markers[0].action)
        self.assertEqual(2, len(of(array, 'bodies', Marker.ADD)))

    def test_ids_stay_while_bodies_move(self):
        first = self.markers.wait(lambda array: len(of(array, 'bodies', Marker.ADD)) == 2)
        pick = self.pick_left()
        self.good('move_pick', pick_id=pick.pick_id, target=Point(-0.1, 0.0, 0.2))
        since = self.markers.count()
        self.good('step', steps=10)
        later = self.markers.wait(lambda array: of(array, 'bodies', Marker.ADD), since)
        self.assertEqual(sorted(m.id for m in of(first, 'bodies', Marker.ADD)),
                         sorted(m.id for m in of(later, 'bodies', Marker.ADD)))

    def test_tools_are_shown_while_they_exist(self):
        self.pick_left()
        self.good('push', enable=True, radius=0.03, pose=pose_stamped(0.0, 0.0, 1.0))
        array = self.markers.wait(lambda array: {0, 1, 2} <= {m.id for m in of(array, 'tools', Marker.ADD)})
        sphere = [m for m in of(array, 'tools', Marker.ADD) if m.type == Marker.SPHERE][0]
        self.assertAlmostEqual(0.06, sphere.scale.x)
        self.assertAlmostEqual(1.0, sphere.pose.position.z)
        springs = [m for m in of(array, 'tools', Marker.ADD) if m.type == Marker.LINE_LIST][0]
        self.assertEqual(2, len(springs.points))
        since = self.markers.count()
        self.good('clear_picks')
        self.good('push', enable=False)
        gone = set()  # in one array, or in two where one was due between the calls

        def all_gone(array):
            gone.update(m.id for m in of(array, 'tools', Marker.DELETE))
            return {0, 1, 2} <= gone
        self.markers.wait(all_gone, since)


class SurfacesTest(DeformerTestCase):

    def surface(self, array, name):
        return [s for s in array.bodies if s.name == name][0]

    def test_who_comes_late_gets_all_even_while_nothing_moves(self):
        for _ in range(2):
            late = self.deformer.recorder('surfaces', Surfaces)
            first = late.wait()
            late.close()
            self.assertEqual(['left', 'right'], sorted(s.name for s in first.bodies))
            for surface in first.bodies:
                mesh = self.good('get_body', name=surface.name).surface
                self.assertEqual(3 * len(mesh.vertices), len(surface.vertices))
                self.assertEqual([i for t in mesh.triangles for i in t.vertex_indices], list(surface.triangles))
                self.assertEqual(len(mesh.triangles), len(surface.cut))
                self.assertEqual({0}, set(surface.cut))
                self.assertEqual((), tuple(surface.strain))
                for vertex, x in zip(mesh.vertices, surface.vertices[0::3]):
                    self.assertAlmostEqual(vertex.x, x, places=6)

    def test_strain_is_zero_at_rest_and_grows_where_tissue_is_pulled(self):
        recorder = self.deformer.recorder('strained_surfaces', Surfaces)
        self.addCleanup(recorder.close)
        rest = recorder.wait(lambda m: m.bodies)
        self.assertLess(max(self.surface(rest, 'left').strain), 1e-5)
        pick = self.pick_left().pick_id
        self.good('lock', pick_id=pick, at_target=True, target=Point(-0.1, 0.0, 0.1))
        for _ in range(30):  # where it is pulled, and before it has followed
            since = recorder.count()
            self.good('step', steps=2)
            pulled = recorder.wait(since=since)
            if max(self.surface(pulled, 'left').strain) > 0.02:
                break
        self.assertGreater(max(self.surface(pulled, 'left').strain), 0.02)
        self.assertEqual(len(self.surface(pulled, 'left').vertices), 3 * len(self.surface(pulled, 'left').strain))
        self.assertLess(max(self.surface(pulled, 'right').strain), 1e-5)


class MovingSurfacesTest(DeformerTestCase):
    """~topology and ~vertices: what bags hold in place of ~surfaces."""

    def setUp(self):
        super().setUp()
        self.reader = SurfaceReader()
        self.topologies = self.deformer.recorder('topology', Topology)
        self.addCleanup(self.topologies.close)
        self.vertices = self.deformer.recorder('vertices', Vertices)
        self.addCleanup(self.vertices.close)

    def surfaces(self, wanted):
        """As the reader has them once it has heard vertices for which wanted(message) holds."""
        last = self.vertices.wait(wanted)
        self.topologies.wait(lambda m: (m.run, m.topology) == (last.run, last.topology))
        topologies, vertices = self.topologies.messages, self.vertices.messages
        vertices = vertices[:vertices.index(last) + 1]
        vertices_first = SurfaceReader()
        for message in vertices + topologies:
            vertices_first.hear(message)
        for message in topologies + vertices:
            self.reader.hear(message)
        surfaces = self.reader.surfaces()
        self.assertEqual(sorted(surfaces), sorted(vertices_first.surfaces()))
        for name, surface in vertices_first.surfaces().items():
            numpy.testing.assert_array_equal(surfaces[name].vertices, surface.vertices)
        return surfaces

    def assert_like_the_bodies(self, surfaces):
        self.assertEqual(sorted(b.name for b in self.state().bodies), sorted(surfaces))
        for name, surface in surfaces.items():
            mesh = self.good('get_body', name=name).surface
            self.assertEqual([list(t.vertex_indices) for t in mesh.triangles], surface.triangles.tolist())
            off = numpy.abs(numpy.array([[v.x, v.y, v.z] for v in mesh.vertices]) - surface.vertices)
            self.assertLess(off.max(), 1e-5)

    def test_who_comes_late_gets_all_even_while_nothing_moves(self):
        surfaces = self.surfaces(lambda m: m.complete)
        self.assert_like_the_bodies(surfaces)
        self.assertFalse(surfaces['left'].cut.any())

    def test_after_a_cut_there_is_another_topology(self):
        first = self.topologies.wait()
        self.vertices.wait(lambda m: m.complete)
        self.good('cut', blades=pose_stamped(-0.2, -1.0, 0.1, ACROSS_X), bodies=['left'])
        surfaces = self.surfaces(lambda m: m.topology > first.topology and len(m.bodies) == 3)
        self.assert_like_the_bodies(surfaces)
        self.assertTrue(surfaces['left.1'].cut.any())

    def test_what_moves_is_said_and_the_rest_is_not(self):
        first = self.vertices.wait(lambda m: m.complete)
        self.good('step', steps=300)  # until both sleep
        began = rospy.Time.now()
        pick = self.pick_left().pick_id
        self.good('lock', pick_id=pick, at_target=True, target=Point(-0.1, 0.0, 0.1))
        for _ in range(20):
            self.good('step', steps=2)
        asked = rospy.Time.now()
        self.good('step', steps=2)
        # Who comes late is told the topology of the case before, too.
        topology = self.topologies.wait(lambda m: (m.run, m.topology) == (first.run, first.topology))
        left = [b.id for b in topology.bodies if b.name == 'left']
        self.vertices.wait(lambda m: m.header.stamp >= asked and left[0] in [b.id for b in m.bodies])
        # How many of them are complete goes by the wall's clock; the others have what moved.
        partial = [m for m in self.vertices.messages if not m.complete and m.header.stamp >= began]
        print('%d of %d are not complete' % (len(partial), self.vertices.count()))
        self.assertEqual([left] * len(partial), [[b.id for b in m.bodies] for m in partial])
        self.good('reset')
        self.assert_like_the_bodies(self.surfaces(lambda m: m.run > first.run))

    def test_an_hour_of_the_liver_is_less_than_two_gigabytes(self):
        with OwnNode(scene='liver', paused=True) as node:
            def bytes_of(topic, kind):
                recorder = Recorder(node.name + '/' + topic, kind)
                message = recorder.wait(lambda m: m.bodies)
                recorder.close()
                buffer = io.BytesIO()
                message.serialize(buffer)
                return len(buffer.getvalue())
            vertices, whole = bytes_of('vertices', Vertices), bytes_of('surfaces', Surfaces)
            rates = {name: rospy.get_param('%s/%s' % (node.name, name), default)
                     for name, default in (('vertices_rate', 30.0), ('surfaces_rate', 60.0))}
            hour = 3600.0 * rates['vertices_rate'] * (vertices + 60)  # a bag adds about as much to each
            print('~vertices: %d bytes, %.2f MB/s, %.2f GB an hour; ~surfaces: %d bytes, %.2f MB/s; ~topology once: %d bytes' % (
                vertices, vertices * rates['vertices_rate'] / 1e6, hour / 1e9, whole, whole * rates['surfaces_rate'] / 1e6,
                bytes_of('topology', Topology)))
            self.assertLess(hour, 2e9)


class ClustersTest(DeformerTestCase):

    def test_every_particle_hangs_on_a_centre(self):
        recorder = self.deformer.recorder('clusters', MarkerArray)
        self.addCleanup(recorder.close)
        array = recorder.wait()
        self.assertEqual(Marker.DELETEALL, array.markers[0].action)
        for body in self.state().bodies:
            particles = self.good('get_body', name=body.name).particles
            at = {struct.unpack_from('fff', particles.data, i * particles.point_step)
                  for i in range(particles.width * particles.height)}
            centres = [m for m in of(array, 'centres', Marker.ADD) if len(m.points) == body.clusters]
            self.assertGreaterEqual(len(centres), 1)
        members = of(array, 'members', Marker.ADD)
        self.assertEqual(2, len(members))
        ends = {struct.unpack('fff', struct.pack('fff', p.x, p.y, p.z)) for m in members for p in m.points[1::2]}
        self.assertTrue(at <= ends)
        starts = {(p.x, p.y, p.z) for m in members for p in m.points[0::2]}
        self.assertEqual({(p.x, p.y, p.z) for m in of(array, 'centres', Marker.ADD) for p in m.points}, starts)
        for marker in members:
            self.assertEqual(len(marker.points), len(marker.colors))


class StateTest(DeformerTestCase):

    def test_a_paused_world_simulates_nothing(self):
        self.states.next(lambda state: state.real_time_factor == 0.0)

    def test_a_running_world_says_how_fast(self):
        self.good('pause', data=False)
        # Right after the reset the factor can still be of the steps before it.
        state = self.states.next(lambda state: state.step > 0 and state.real_time_factor > 0.0)
        self.assertGreater(state.sim_time, 0.0)


class EventsTest(DeformerTestCase):

    def test_what_happens_is_said_once(self):
        self.state()  # what was said of the reset before is out by then
        events = self.deformer.recorder('events', Event)
        pick = self.pick_left()
        self.good('lock', pick_id=pick.pick_id)
        self.good('release', pick_id=pick.pick_id)
        self.good('step', steps=3)
        self.good('spawn', name='new', pose=pose_stamped(0, 0, 1),
                  primitive=SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.1, 0.1, 0.1]))
        self.good('remove', name='new')
        self.good('cut', blades=pose_stamped(-0.19, -1.0, 0.1, ACROSS_X))
        self.good('reset')
        events.wait(lambda event: event.type == 'reset')
        said = [(e.type, e.body) for e in events.messages]
        for wanted in (('picked', 'left'), ('locked', 'left'), ('released', 'left'), ('spawned', 'new'),
                       ('removed', 'new'), ('cut', 'left'), ('reset', '')):
            self.assertEqual(1, said.count(wanted), '%s in %s' % (wanted, said))
        by_type = {e.type: e for e in events.messages}
        self.assertEqual(pick.pick_id, by_type['picked'].pick_id)
        self.assertEqual(0, by_type['picked'].step)
        self.assertEqual(3, by_type['cut'].step)
        self.assertAlmostEqual(3.0 / 120.0, by_type['cut'].sim_time)
        for event in events.messages:
            self.assertEqual('world', event.header.frame_id)
            self.assertNotEqual('', event.text)
        events.close()

    def test_the_push_sphere_touches(self):
        events = self.deformer.recorder('events', Event)
        self.good('push', enable=True, radius=0.03, pose=pose_stamped(-0.3, 0.0, 0.1))
        self.good('push', enable=True, radius=0.03, pose=pose_stamped(-0.2, 0.0, 0.1), speed=0.2)
        self.good('step', steps=60)
        self.assertEqual('left', events.wait(lambda event: event.type == 'touched').body)
        events.close()


class DiagnosticsTest(DeformerTestCase):

    def setUp(self):
        super().setUp()
        self.diagnostics = self.deformer.recorder('/diagnostics', DiagnosticArray)

    def tearDown(self):
        self.diagnostics.close()
        super().tearDown()

    def values(self):
        """Of the second array from now: the first may have been on its way."""
        since = self.diagnostics.count()
        self.diagnostics.wait(since=since)
        array = self.diagnostics.wait(since=since + 1)
        status = [s for s in array.status if 'deformer' in s.name and 'simulation' in s.name]
        self.assertEqual(1, len(status))
        return status[0], {v.key: v.value for v in status[0].values}

    def test_rates_and_rejected_input(self):
        _, before = self.values()
        for key in ('step rate [Hz]', 'real-time factor', 'overruns', 'rejected input'):
            self.assertIn(key, before)
        self.call('release', pick_id=4000000000)
        self.call('cut', blades=pose_stamped(float('nan')))
        _, after = self.values()
        self.assertEqual(int(before['rejected input']) + 2, int(after['rejected input']))
        self.assertIn('~cut', after['last rejection'])

    def test_memory_per_particle(self):
        _, values = self.values()
        parts = sum(float(values['memory %s [MB]' % part]) for part in (
            'of models', 'of states', 'of contact', 'for reset and undo'))
        particles = int(values['particles'])
        self.assertGreater(particles, 0)
        self.assertGreater(parts, 0.0)
        self.assertAlmostEqual(1e6 * parts / particles, float(values['memory per particle [bytes]']),
                               delta=1e-3 * 1e6 * parts / particles)

    def test_a_miss_is_no_rejected_input(self):
        _, before = self.values()
        self.assertFalse(self.call('pick', point=Point(0, 0, 50), max_distance=0.01).success)
        _, after = self.values()
        self.assertEqual(before['rejected input'], after['rejected input'])

    def test_nothing_is_built_for_nobody(self):
        self.states.close()
        self.good('pause', data=False)
        self.good('step', steps=10)
        self.values()
        _, before = self.values()
        self.good('step', steps=100)
        _, after = self.values()
        self.assertGreater(int(after['steps']), int(before['steps']))
        for key in ('marker arrays built', 'surfaces built', 'vertices built', 'clusters built', 'contacts built', 'point clouds built', 'states built'):
            self.assertEqual(before[key], after[key], key)
        markers = self.deformer.recorder('markers', MarkerArray)
        markers.wait()
        _, watched = self.values()
        self.assertGreater(int(watched['marker arrays built']), int(after['marker arrays built']))
        self.assertEqual(after['point clouds built'], watched['point clouds built'])
        self.assertEqual(after['surfaces built'], watched['surfaces built'])
        markers.close()
        self.good('pause', data=True)


if __name__ == '__main__':
    run('topics', MarkersTest, SurfacesTest, MovingSurfacesTest, ClustersTest, StateTest, EventsTest, DiagnosticsTest)
