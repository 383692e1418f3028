#!/usr/bin/env python3
"""Every service: a good call, and what must be refused."""
import math
import os
import sys
import tempfile
import threading

from geometry_msgs.msg import Point, Vector3
from meshless_surgery.msg import Event
from meshless_surgery.srv import CutResponse, SpawnResponse, StepResponse
from shape_msgs.msg import SolidPrimitive

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import ACROSS_X, DeformerTestCase, pose_stamped, run  # noqa: E402

NAN = float('nan')
INF = float('inf')


def box(x=0.1, y=0.1, z=0.1):
    return SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[x, y, z])


class PickTest(DeformerTestCase):

    def test_the_nearest_particle_is_grabbed(self):
        answer = self.pick_left()
        self.assertEqual('left', answer.body)
        self.assertGreater(answer.pick_id, 0)
        self.assertLess(math.dist((answer.position.x, answer.position.y, answer.position.z), (-0.15, 0.0, 0.1)), 0.05)
        picks = self.state().picks
        self.assertEqual([(answer.pick_id, 'left', False)], [(p.pick_id, p.body, p.locked) for p in picks])

    def test_ids_are_never_used_twice(self):
        ids = []
        for _ in range(5):
            answer = self.pick_left()
            ids.append(answer.pick_id)
            self.good('release', pick_id=answer.pick_id)
        self.assertEqual(5, len(set(ids)))

    def test_refusals(self):
        at = Point(-0.15, 0.0, 0.1)
        for value, word in ((NAN, 'nan'), (INF, 'inf'), (-INF, '-inf')):
            self.refused(['point.y', word, 'accepted'], 'pick', point=Point(-0.15, value, 0.1))
            self.refused(['direction.z', word, 'accepted'], 'pick', point=at, direction=Vector3(0, 0, value))
            self.refused(['max_distance', word, 'accepted'], 'pick', point=at, max_distance=value)
            self.refused(['stiffness', word, 'accepted'], 'pick', point=at, stiffness=value)
        self.refused(['max_distance', '-0.1', '0..'], 'pick', point=at, max_distance=-0.1)
        self.refused(['stiffness', '-1', '0..'], 'pick', point=at, stiffness=-1.0)
        self.refused(['no_such_body', 'left', 'right'], 'pick', point=at, body='no_such_body')
        self.refused(['0.01'], 'pick', point=Point(0.0, 0.0, 0.1), max_distance=0.01)
        self.refused([], 'pick', point=Point(0.0, 5.0, 0.1), direction=Vector3(0, 1, 0))


class NothingToDoTest(DeformerTestCase):
    """What is so already is no error, but is said."""

    def test_nothing_is_there(self):
        for service, fields in (('clear_picks', {}), ('lift_scissors', {}), ('push', dict(enable=False))):
            self.assertRegex(self.good(service, **fields).message, '^there (was|were) no .* to ', service)
        self.pick_left()
        self.assertEqual('released all picks: 1', self.good('clear_picks').message)
        self.good('push', enable=True, radius=0.03, pose=pose_stamped(0.0, 0.0, 1.0))
        self.assertEqual('removed the push sphere', self.good('push', enable=False).message)

    def test_a_push_at_a_speed_says_whether_it_goes_or_is_placed(self):
        there = dict(enable=True, radius=0.03, speed=0.25)
        self.assertIn('placed the push sphere there: there was none', self.good('push', pose=pose_stamped(0.0, 0.0, 1.0), **there).message)
        self.assertEqual('the push sphere goes there at 0.25 m/s', self.good('push', pose=pose_stamped(0.0, 0.0, 1.5), **there).message)
        self.good('push', enable=False)

    def test_a_material_of_no_key_is_refused(self):
        for yaml in ('{}', '# nothing', 'null'):
            self.refused(['no key', 'accepted', 'density'], 'set_material', body='left', yaml=yaml)


class SpringTest(DeformerTestCase):

    def test_moving_pulls_the_tissue(self):
        pick = self.pick_left()
        self.good('move_pick', pick_id=pick.pick_id, target=Point(-0.05, 0.0, 0.1))
        before = self.state().bodies[0].centre_of_mass.x
        self.good('step', steps=30)
        state = self.state()
        self.assertGreater(state.bodies[0].centre_of_mass.x, before + 0.001)
        self.assertAlmostEqual(-0.05, state.picks[0].target.x)

    def test_any_number_of_locks_and_taking_one_up_again(self):
        ids = [self.pick_left().pick_id for _ in range(10)]
        for pick in ids:
            self.good('lock', pick_id=pick)
        self.assertEqual(10, sum(p.locked for p in self.state().picks))
        self.good('move_pick', pick_id=ids[3], target=Point(0, 0, 0))
        self.assertEqual([ids[3]], [p.pick_id for p in self.state().picks if not p.locked])

    def test_release_and_clear(self):
        ids = [self.pick_left().pick_id for _ in range(3)]
        self.good('lock', pick_id=ids[0])
        self.good('release', pick_id=ids[0])
        self.assertEqual(ids[1:], [p.pick_id for p in self.state().picks])
        self.good('clear_picks')
        self.assertEqual([], self.state().picks)

    def test_refusals(self):
        pick = self.pick_left().pick_id
        for service in ('move_pick', 'lock', 'release'):
            self.refused(['4000000000', str(pick)], service, pick_id=4000000000)
            self.refused(['0'], service, pick_id=0)
        self.refused(['target.x', 'nan'], 'move_pick', pick_id=pick, target=Point(NAN, 0, 0))
        self.refused(['target.z', 'inf'], 'move_pick', pick_id=pick, target=Point(0, 0, INF))
        self.refused(['target.x', 'nan'], 'lock', pick_id=pick, at_target=True, target=Point(NAN, 0, 0))


class PushTest(DeformerTestCase):

    def test_it_is_placed_moves_at_its_speed_and_pushes(self):
        self.good('push', enable=True, radius=0.03, pose=pose_stamped(-0.3, 0.0, 0.1))
        self.good('push', enable=True, radius=0.03, pose=pose_stamped(-0.2, 0.0, 0.1), speed=0.2)
        before = self.state().bodies[0].centre_of_mass.x
        self.good('step', steps=60)  # 0.5 s: it has arrived where the box's middle was
        self.assertGreater(self.state().bodies[0].centre_of_mass.x, before + 0.005)
        self.good('push', enable=False)

    def test_refusals(self):
        self.refused(['radius', '-0.01', '0..'], 'push', enable=True, radius=-0.01, pose=pose_stamped())
        self.refused(['radius', 'nan'], 'push', enable=True, radius=NAN, pose=pose_stamped())
        self.refused(['speed', '-1'], 'push', enable=True, speed=-1.0, pose=pose_stamped())
        self.refused(['speed', 'inf'], 'push', enable=True, speed=INF, pose=pose_stamped())
        self.refused(['position.x', 'nan'], 'push', enable=True, pose=pose_stamped(NAN))


class CutTest(DeformerTestCase):

    def test_a_cut_gives_sealed_pieces_that_add_up(self):
        whole = self.good('get_body', name='left')
        answer = self.good('cut', blades=pose_stamped(-0.19, -1.0, 0.1, ACROSS_X))
        self.assertEqual(['left'], answer.cut_bodies)
        self.assertEqual(['left.1', 'left.2'], answer.new_bodies)
        self.assertAlmostEqual(0.01, answer.cap_area, places=6)
        self.assertGreaterEqual(answer.duration, 0.0)
        self.assertGreater(answer.rebuilt_clusters, 0)
        self.assertIn('%d clusters rebuilt, %d kept' % (answer.rebuilt_clusters, answer.kept_clusters), answer.message)
        pieces = [self.good('get_body', name=name) for name in answer.new_bodies]
        self.assertAlmostEqual(1.0, sum(p.volume for p in pieces) / whole.volume, places=9)
        self.assertAlmostEqual(1.0, sum(p.mass for p in pieces) / whole.mass, places=9)
        for piece in pieces:
            edges = {}
            for triangle in piece.surface.triangles:
                v = triangle.vertex_indices
                for a, b in ((v[0], v[1]), (v[1], v[2]), (v[2], v[0])):
                    edges[(a, b)] = edges.get((a, b), 0) + 1
            self.assertTrue(all(edges.get((b, a)) == n for (a, b), n in edges.items()), 'an open edge')
        self.assertEqual(['left.1', 'left.2', 'right'], sorted(b.name for b in self.state().bodies))
        self.refused(['left', 'left.1'], 'get_body', name='left')

    def test_pieces_can_be_cut_again_and_springs_follow(self):
        pick = self.pick_left()
        self.good('cut', blades=pose_stamped(-0.2, -1.0, 0.1, ACROSS_X), bodies=['left'])
        owner = self.state().picks[0].body
        self.assertIn(owner, ('left.1', 'left.2'))
        self.assertEqual(pick.pick_id, self.state().picks[0].pick_id)
        again = self.good('cut', blades=pose_stamped(-1.0, 0.0, 0.1), bodies=[owner])
        self.assertEqual([owner + '.1', owner + '.2'], again.new_bodies)

    def test_an_incision_opens_and_a_second_one_goes_through(self):
        whole = self.good('get_body', name='left')
        upwards = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))  # the blade's y axis points up
        opened = self.good('incise', blade=pose_stamped(-0.3, 0.01, 0.3, upwards), length=0.2, depth=0.19)
        self.assertEqual(['left'], opened.cut_bodies)
        self.assertEqual([], opened.new_bodies)
        self.assertGreater(opened.opened_area, 0.001)
        self.assertAlmostEqual(1.0, self.good('get_body', name='left').volume / whole.volume, places=9)
        self.assertGreater(opened.rebuilt_clusters, 0)
        self.assertIn('%d kept' % opened.kept_clusters, opened.message)
        self.refused(['open there'], 'incise', blade=pose_stamped(-0.3, 0.01, 0.3, upwards), length=0.2, depth=0.19)
        apart = self.good('incise', blade=pose_stamped(-0.3, 0.01, 0.3, upwards), length=0.2, depth=0.5)
        self.assertEqual(['left.1', 'left.2'], apart.new_bodies)
        pieces = [self.good('get_body', name=name) for name in apart.new_bodies]
        self.assertAlmostEqual(1.0, sum(p.volume for p in pieces) / whole.volume, places=9)
        self.refused(['met no body'], 'incise', blade=pose_stamped(5.0, 5.0, 5.0, upwards), length=0.2, depth=0.1)
        self.refused(['reach the surface'], 'incise', blade=pose_stamped(0.19, 0.0, 0.12, upwards), length=0.02,
                     depth=0.02)

    def test_open_scissors_without_a_cut_says_so(self):
        self.refused(['no scissors are closing'], 'open_scissors')

    def test_a_cut_is_undone(self):
        self.refused(['no cut to undo'], 'undo_cut')
        pick = self.pick_left().pick_id
        self.good('lock', pick_id=pick)
        self.good('step', steps=5)
        before = self.picture()
        self.good('cut', blades=pose_stamped(-0.2, -1.0, 0.1, ACROSS_X), bodies=['left'])
        self.assertEqual({'left.1', 'left.2', 'right'}, {b.name for b in self.state().bodies})
        self.assertIn('left', self.good('undo_cut').message)
        self.assertEqual(before, self.picture())
        # And a second cut's pieces do not take the names of the first's.
        again = self.good('cut', blades=pose_stamped(-0.2, -1.0, 0.1, ACROSS_X), bodies=['left'])
        self.assertEqual(['left.3', 'left.4'], sorted(again.new_bodies))
        self.good('reset')
        self.refused(['no cut to undo'], 'undo_cut')

    def test_a_probe_says_what_a_ray_meets(self):
        before = self.picture()
        met = self.good('probe', point=Point(-0.21, 0.01, 3.0), direction=Vector3(0, 0, -2))
        self.assertEqual('left', met.body)
        self.assertAlmostEqual(0.15, met.position.z, places=6)
        self.assertAlmostEqual(1.0, met.normal.z, places=6)
        self.assertEqual(before, self.picture())
        self.refused(['no tissue'], 'probe', point=Point(0, 0, 3), direction=Vector3(0, 0, 1))
        self.refused(['direction', '0'], 'probe', point=Point(0, 0, 3))
        self.refused(['point.y', 'nan'], 'probe', point=Point(0, NAN, 3), direction=Vector3(0, 0, 1))

    def test_blades_that_close_slowly_meet_at_once_while_paused(self):
        answer = self.good('cut', blades=pose_stamped(-1.0, 0.0, 0.1), close_time=50.0)
        self.assertIn('paused', answer.message)
        self.assertEqual(0, self.state().step)

    def test_refusals(self):
        blades = pose_stamped(-1.0, 0.0, 0.1)
        for field in ('length', 'width', 'close_time', 'roughness'):
            self.refused([field, 'nan', 'accepted'], 'cut', blades=blades, **{field: NAN})
            self.refused([field, 'inf', 'accepted'], 'cut', blades=blades, **{field: INF})
            self.refused([field, '-0.5', '0'], 'cut', blades=blades, **{field: -0.5})
        self.refused(['close_time', '1000', '60'], 'cut', blades=blades, close_time=1000.0)
        self.refused(['position.x', 'nan'], 'cut', blades=pose_stamped(NAN))
        self.refused(['no_such_body'], 'cut', blades=blades, bodies=['left', 'no_such_body'])
        self.refused(['bodies[0]'], 'cut', blades=blades, bodies=[''])
        self.refused([], 'cut', blades=pose_stamped(0.0, 0.0, 5.0))


class BodiesTest(DeformerTestCase):

    def test_primitives_are_spawned_and_removed(self):
        sizes = {SolidPrimitive.BOX: [0.1, 0.05, 0.08], SolidPrimitive.SPHERE: [0.05],
                 SolidPrimitive.CYLINDER: [0.1, 0.03]}
        volumes = {SolidPrimitive.BOX: 4e-4, SolidPrimitive.SPHERE: 4 / 3 * math.pi * 0.05 ** 3,
                   SolidPrimitive.CYLINDER: 0.1 * math.pi * 0.03 ** 2}
        for kind, dimensions in sizes.items():
            answer = self.good('spawn', name='new%d' % kind, pose=pose_stamped(0.0, 0.0, 1.0),
                               primitive=SolidPrimitive(type=kind, dimensions=dimensions))
            self.assertEqual('new%d' % kind, answer.name)
            for count in (answer.particles, answer.triangles, answer.clusters):
                self.assertGreater(count, 0)
            body = self.good('get_body', name=answer.name)
            self.assertLess(abs(body.volume / volumes[kind] - 1.0), 0.05)
            self.good('remove', name=answer.name)
            self.refused([answer.name], 'remove', name=answer.name)

    def test_without_a_name_it_gets_one_of_its_own(self):
        names = [self.good('spawn', primitive=box(), pose=pose_stamped(0, 0, 1 + i)).name for i in range(3)]
        self.assertEqual(['box', 'box_2', 'box_3'], names)

    def test_a_file_below_the_scene(self):
        # Below the scene's folder, where reading is allowed.
        scenes = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes')
        answer = self.good('spawn', file=os.path.join(scenes, 'tetrahedron.obj'), pose=pose_stamped(0, 0, 1))
        self.assertEqual('tetrahedron', answer.name)
        self.assertGreaterEqual(answer.triangles, 4)  # parted, for cells to lead it
        relative = self.good('spawn', name='again', file='tetrahedron.obj', pose=pose_stamped(0, 0, 1))
        package = self.good('spawn', name='package', pose=pose_stamped(0, 0, 1), scale=0.5,
                            file='package://meshless_surgery/test/ros/scenes/tetrahedron.obj')
        volumes = [self.good('get_body', name=a.name).volume for a in (answer, relative, package)]
        self.assertAlmostEqual(0.1 ** 3 / 6.0, volumes[0], places=9)
        self.assertAlmostEqual(volumes[0], volumes[1], places=12)
        self.assertAlmostEqual(volumes[0] / 8.0, volumes[2], places=12)

    def test_what_is_no_size_of_an_organ_is_said_and_units_are_known(self):
        events = self.deformer.recorder('events', Event)
        self.addCleanup(events.close)
        large = self.good('spawn', file='tetrahedron.obj', pose=pose_stamped(0, 0, 500), scale=1000.0)
        self.assertIn('it is 100 m long', large.message)
        self.assertIn('units: mm', large.message)
        events.wait(lambda event: event.body == large.name and 'it is 100 m long' in event.text)
        organ = self.good('spawn', name='organ', file='tetrahedron.obj', pose=pose_stamped(0, 0, 1), scale=1000.0, units='mm')
        self.assertNotIn('long', organ.message)
        self.assertAlmostEqual(0.1 ** 3 / 6.0, self.good('get_body', name='organ').volume, places=9)
        self.refused(["units is 'inch'", 'm, cm, mm'], 'spawn', file='tetrahedron.obj', pose=pose_stamped(0, 0, 1), units='inch')

    def test_a_bladder_is_filled_and_a_cut_lets_it_out(self):
        events = self.deformer.recorder('events', Event)
        self.addCleanup(events.close)
        bladder = dict(file='package://meshless_surgery/config/meshes/bladder.obj', pose=pose_stamped(0, 0, 10),
                       material='elastic_muscle')
        empty = self.good('spawn', name='empty', **bladder)
        self.assertIn('it has 1 cavity of 47 ml, that is empty', empty.message)
        self.good('remove', name='empty')
        self.refused(['pressure is -1', '0 to 1e+06 Pa'], 'spawn', cavities='{pressure: -1}', **bladder)
        self.refused(['volume is 1000 ml', '47.0133 ml at rest'], 'spawn', cavities='{volume: 1000}', **bladder)
        self.refused(['cavities has'], 'spawn', cavities=' ' * 2000, **bladder)
        self.refused(['it has none'], 'spawn', file='tetrahedron.obj', pose=pose_stamped(0, 0, 10), cavities='{pressure: 1}')
        self.good('spawn', name='bladder', cavities='{pressure: 100, leak: 0.2}', **bladder)
        self.good('step', steps=60)
        cavity, = self.good('get_body', name='bladder').cavities
        self.assertAlmostEqual(100.0, cavity.pressure)
        self.assertFalse(cavity.open)
        self.assertGreater(cavity.volume, 47e-6)
        rest, = self.good('get_body', name='bladder', rest=True).cavities
        self.assertAlmostEqual(47.0133e-6, rest.volume, places=9)
        state = self.state()
        self.assertEqual([1], [len(body.cavities) for body in state.bodies if body.name == 'bladder'])
        centre = [body.centre_of_mass.z for body in state.bodies if body.name == 'bladder'][0]
        cut = self.good('cut', blades=pose_stamped(-1, 0, centre), bodies=['bladder'])
        self.assertEqual(2, len(cut.new_bodies))
        events.wait(lambda event: event.type == Event.LEAK and event.body == cut.new_bodies[0] and 'is open' in event.text)
        self.assertTrue(all(self.good('get_body', name=name).cavities[0].open for name in cut.new_bodies))
        self.good('step', steps=25)
        for name in cut.new_bodies:  # and stays in its place
            cavity, = self.good('get_body', name=name).cavities
            self.assertEqual((0.0, True), (cavity.pressure, cavity.open))
        events.wait(lambda event: event.type == Event.LEAK and event.body == cut.new_bodies[1] and 'leaked out' in event.text)

    def test_a_dirty_file_is_repaired_as_far_as_asked(self):
        at = pose_stamped(0, 0, 1)
        for repair in ('', 'mend'):
            answer = self.good('spawn', file='dirty.obj', pose=at, repair=repair)
            self.assertGreaterEqual(answer.triangles, 4)  # parted, for cells to lead it
            self.assertIn('dropped 1 open piece', answer.message)
            self.assertAlmostEqual(0.1 ** 3 / 6.0, self.good('get_body', name=answer.name).volume, places=9)
        wrapped = self.good('spawn', file='dirty.obj', pose=at, repair='wrap')
        self.assertGreater(wrapped.triangles, 100)
        self.assertIn('wrapped it', wrapped.message)
        self.assertIn('the surface now encloses', wrapped.message)
        refused = self.refused(['dirty.obj', 'not manifold', 'up to 3 triangles'], 'spawn', file='dirty.obj', pose=at, repair='none')
        self.assertEqual(SpawnResponse.UNSUITABLE_SHAPE, refused.error_code)
        self.refused(["repair is 'weld'", 'none, mend, wrap'], 'spawn', file='dirty.obj', pose=at, repair='weld')

    def test_refusals_of_spawn(self):
        at = pose_stamped(0, 0, 1)
        self.refused(['left'], 'spawn', name='left', primitive=box(), pose=at)
        self.refused(['name', 'a/b'], 'spawn', name='a/b', primitive=box(), pose=at)
        self.refused(['primitive.type', '0'], 'spawn', name='x', pose=at)
        self.refused(['primitive.type', '4'], 'spawn', name='x', pose=at,
                     primitive=SolidPrimitive(type=SolidPrimitive.CONE, dimensions=[0.1, 0.1]))
        self.refused(['dimensions', '2', '3'], 'spawn', name='x', pose=at,
                     primitive=SolidPrimitive(type=SolidPrimitive.BOX, dimensions=[0.1, 0.1]))
        for bad, word in ((NAN, 'nan'), (-0.1, '-0.1'), (0.0, '0'), (INF, 'inf')):
            self.refused(['dimensions', ' y ', word, 'accepted'], 'spawn', name='x', pose=at, primitive=box(0.1, bad, 0.1))
        self.refused(['scale', '-1'], 'spawn', name='x', primitive=box(), pose=at, scale=-1.0)
        self.refused(['scale', 'nan'], 'spawn', name='x', primitive=box(), pose=at, scale=NAN)
        self.refused(['no_such_material'], 'spawn', name='x', primitive=box(), pose=at, material='no_such_material')
        self.refused(['missing.obj'], 'spawn', name='x', file='missing.obj', pose=at)
        with tempfile.NamedTemporaryFile(suffix='.obj') as outside:
            outside.write(b'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n')
            outside.flush()
            self.refused([outside.name], 'spawn', name='x', file=outside.name, pose=at)

    def test_refusals_of_remove_and_get_body(self):
        for service in ('remove', 'get_body'):
            self.refused(['no_such_body', 'left', 'right'], service, name='no_such_body')
            self.refused([], service, name='')

    def test_get_body_at_rest_and_as_it_is(self):
        pick = self.pick_left()
        self.good('move_pick', pick_id=pick.pick_id, target=Point(0.0, 0.0, 0.1))
        self.good('step', steps=10)
        now = self.good('get_body', name='left')
        rest = self.good('get_body', name='left', rest=True)
        self.assertEqual(len(now.surface.triangles), len(rest.surface.triangles))
        self.assertEqual(now.particles.width, rest.particles.width)
        self.assertEqual(['x', 'y', 'z'], [f.name for f in now.particles.fields])
        self.assertAlmostEqual(1e-3, rest.volume, places=9)
        self.assertAlmostEqual(1e-3, now.rest_volume, places=9)
        self.assertAlmostEqual(0.06, rest.area, places=9)
        self.assertNotEqual(now.particles.data, rest.particles.data)
        self.assertEqual('world', now.particles.header.frame_id)
        self.assertGreater(now.tetrahedra, 0)
        self.assertGreater(now.clusters, 0)

    def test_refusals_of_set_material(self):
        self.refused(['no_such_body'], 'set_material', body='no_such_body', yaml='{alpha: 0.5}')
        self.refused(['yaml'], 'set_material', body='left', yaml='')
        self.refused(['alpha', '1.5'], 'set_material', body='left', yaml='{alpha: 1.5}')
        self.refused(['alpha'], 'set_material', body='left', yaml='{alpha: .nan}')
        self.refused(['alpah', 'alpha'], 'set_material', body='left', yaml='{alpah: 0.5}')
        self.refused(['poissons_ratio', '0.3', 'appearance'], 'set_material', body='left', yaml='{poissons_ratio: 0.3}')
        self.refused([], 'set_material', body='left', yaml='{alpha: [')
        self.refused([], 'set_material', yaml='just words')


class TimeTest(DeformerTestCase):

    def test_refusals_of_step(self):
        self.refused(['steps', '0', '1..100000'], 'step', steps=0)
        self.refused(['steps', '100001', '1..100000'], 'step', steps=100001)

    def test_pause_and_run(self):
        self.good('pause', data=False)
        self.states.next(lambda state: state.step >= 10)
        answer = self.good('pause', data=True)
        step = self.state().step
        self.assertIn(str(step), answer.message)
        self.assertEqual(step, self.state().step)

    def test_reset_brings_the_start_back(self):
        start = self.picture()
        pick = self.pick_left()
        self.good('move_pick', pick_id=pick.pick_id, target=Point(0, 0, 0))
        self.good('step', steps=20)
        self.good('spawn', name='new', primitive=box(), pose=pose_stamped(0, 0, 1))
        self.good('cut', blades=pose_stamped(-1.0, 0.0, 0.1))
        self.good('set_material', yaml='{density: 300}')
        self.assertNotEqual(start, self.picture())
        self.good('reset')
        self.assertEqual(start, self.picture())

    def test_the_same_calls_give_the_same_world(self):
        pictures = []
        for _ in range(2):
            self.good('reset')
            pick = self.pick_left()
            self.good('move_pick', pick_id=pick.pick_id, target=Point(-0.1, 0.05, 0.1))
            self.good('step', steps=25)
            self.good('cut', blades=pose_stamped(-1.0, 0.0, 0.1))
            self.good('clear_picks')
            self.good('step', steps=25)
            pictures.append(self.picture())
        self.assertEqual(pictures[0], pictures[1])

    def test_looking_changes_nothing(self):
        self.states.close()
        shapes = []
        for reads in (False, True):
            self.good('reset')
            pick = self.pick_left()
            self.good('move_pick', pick_id=pick.pick_id, target=Point(-0.1, 0.05, 0.1))
            self.good('step', steps=10)
            pieces = self.good('cut', blades=pose_stamped(-1.0, 0.0, 0.1), bodies=['left']).new_bodies
            for _ in range(10):
                self.good('step', steps=1)
                if reads:
                    for name in pieces:
                        self.good('get_body', name=name)
            ends = [self.good('get_body', name=name) for name in pieces]
            shapes.append([(end.particles.data, end.volume, end.area) for end in ends])
        self.assertEqual(shapes[0], shapes[1])

    def test_incisions_out_of_range(self):
        self.refused(['length', 'nan'], 'incise', blade=pose_stamped(), length=NAN, depth=0.1)
        self.refused(['depth', '0'], 'incise', blade=pose_stamped(), length=0.1, depth=0.0)


class ErrorCodeTest(DeformerTestCase):

    def test_each_refusal_says_of_which_kind_it_is(self):
        at = pose_stamped(0, 0, 1)
        with tempfile.NamedTemporaryFile(suffix='.obj') as outside:
            outside.write(b'v 0 0 0\n')
            outside.flush()
            for code, service, fields in (
                    (SpawnResponse.INVALID_ARGUMENT, 'pick', dict(point=Point(NAN, 0, 0))),
                    (SpawnResponse.INVALID_ARGUMENT, 'step', dict(steps=0)),
                    (SpawnResponse.UNKNOWN_NAME, 'get_body', dict(name='no_such_body')),
                    (SpawnResponse.UNKNOWN_NAME, 'release', dict(pick_id=4000000000)),
                    (SpawnResponse.UNKNOWN_NAME, 'cut', dict(blades=pose_stamped(frame='no_such_frame'))),
                    (SpawnResponse.DUPLICATE_NAME, 'spawn', dict(name='left', primitive=box(), pose=at)),
                    (SpawnResponse.UNREADABLE, 'spawn', dict(name='x', file='missing.obj', pose=at)),
                    (SpawnResponse.FORBIDDEN, 'spawn', dict(name='x', file=outside.name, pose=at)),
                    (SpawnResponse.UNSUITABLE_SHAPE, 'spawn', dict(name='x', file='flat.obj', pose=at)),
                    (SpawnResponse.MISSED, 'cut', dict(blades=pose_stamped(0.0, 0.0, 5.0))),
                    (SpawnResponse.MISSED, 'probe', dict(point=Point(0, 0, 3), direction=Vector3(0, 0, 1)))):
                with self.subTest(service=service, code=code):
                    self.assertEqual(code, self.refused([], service, **fields).error_code)

    def test_what_was_given_up_has_failed(self):
        self.good('pause', data=False)
        answers = []
        closing = threading.Thread(target=lambda: answers.append(self.call('cut', blades=pose_stamped(-1.0, 0.0, 0.1),
                                                                           close_time=60.0)))
        closing.start()
        while not self.call('open_scissors').success:  # not closing yet
            pass
        closing.join()
        self.assertEqual([(False, CutResponse.MISSED)], [(a.success, a.error_code) for a in answers])
        closing = threading.Thread(target=lambda: answers.append(self.call('step', steps=100000)))
        closing.start()
        self.states.next(lambda state: state.step > 100)
        self.good('reset')
        closing.join()
        self.assertEqual((False, StepResponse.FAILED), (answers[1].success, answers[1].error_code))


if __name__ == '__main__':
    run('services', ErrorCodeTest, PickTest, SpringTest, PushTest, CutTest, BodiesTest, TimeTest)
