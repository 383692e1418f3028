#!/usr/bin/env python3
"""What holds bodies together, through the node: the scene's attachment, ~attach, ~detach, cuts, tears, and what is shown."""
import os
import sys
import tempfile

import rospy
from geometry_msgs.msg import Point
from meshless_surgery import ErrorCode, Refused, Surgeon
from meshless_surgery.msg import Event
from meshless_surgery.topics import connected
from visualization_msgs.msg import MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from deformer_support import DeformerTestCase, OwnNode, run  # noqa: E402

NAN = float('nan')
SCENES = os.path.join(os.path.dirname(os.path.abspath(__file__)), 'scenes')


class AttachTest(DeformerTestCase):

    def setUp(self):
        super().setUp()
        self.surgeon = Surgeon('/deformer')
        self.surgeon.stepped()

    def fibres(self):
        return {attachment.name: attachment.fibres for attachment in self.state().attachments}

    def shown(self):
        """Points of the marker of fibres, in a message that was made after now."""
        now = rospy.Time.now()
        while True:
            markers = rospy.wait_for_message('/deformer/markers', MarkerArray, 60.0).markers
            if markers and markers[-1].header.stamp > now:
                return [len(m.points) for m in markers if (m.ns, m.id, m.action) == ('tools', 4, m.ADD)]

    def test_the_scene_holds_them_together_and_says_so(self):
        self.surgeon.live(2.0)
        state = self.state()
        bed, = state.attachments
        self.assertEqual(('bed', ['gallbladder', 'liver']), (bed.name, list(bed.ends)))
        self.assertEqual(bed.made, bed.fibres)
        self.assertAlmostEqual(0.0024, bed.area, delta=1e-6)
        weight = 9.81 * [body.mass for body in state.bodies if body.name == 'gallbladder'][0]
        self.assertAlmostEqual(weight, bed.force, delta=0.05 * weight)
        self.assertEqual([2 * bed.fibres], self.shown())

    def test_what_is_joined_and_what_is_not_is_said_at_the_start(self):
        with OwnNode(scene=os.path.join(SCENES, 'attached.yaml'), paused=True).wait() as node:
            self.assertEqual(0, node.end(2))
            said = node.output()  # all of it, once the node has ended
        self.assertRegex(said, r'attachment bed: \d+ fibres on 24 cm\^2, in 1 patch: 24 cm\^2 around \(')
        self.assertNotIn('hang together with nothing', said)  # a clamp joins what it holds with the rest
        with tempfile.TemporaryDirectory() as folder:
            with open(os.path.join(folder, 'two.obj'), 'w', encoding='ascii') as file:
                for number, at in enumerate((0.0, 0.2)):
                    for corner in range(8):
                        file.write('v %g %g %g\n' % (at + 0.1 * (corner & 1), 0.05 * (corner & 2), 0.1 * (corner >> 2)))
                    for face in ((1, 3, 4, 2), (5, 6, 8, 7), (1, 2, 6, 5), (3, 7, 8, 4), (1, 5, 7, 3), (2, 4, 8, 6)):
                        file.write('f %d %d %d %d\n' % tuple(8 * number + k for k in face))
            with open(os.path.join(folder, 'two.yaml'), 'w', encoding='ascii') as file:
                file.write('bodies: [{name: two, file: two.obj, material: elastic_liver, pose: {position: [0, 0, 0.1]}}]\n')
            with OwnNode(scene=os.path.join(folder, 'two.yaml'), paused=True).wait() as node:
                self.assertRegex(node.output(), r'body two: it has 2 parts that hang together with nothing: 50 % of its mass around \(')

    def test_joining_and_taking_apart(self):
        more = self.surgeon.attach('liver', 'gallbladder', stiffness=1e5, distance=0.01)
        self.assertEqual('liver-gallbladder', more.name)
        self.assertGreater(more.fibres, 4)
        self.assertIn('%d fibres on %.3g cm^2, in ' % (more.fibres, 1e4 * more.area), more.message)
        world = self.surgeon.attach('gallbladder', 'world', stiffness=1e5, centre=(0.03, 0, 0.16), radius=0.02)
        self.assertLess(world.area, more.area)
        self.assertEqual({'bed', more.name, world.name}, set(self.fibres()))
        part = self.surgeon.detach('bed', centre=(-0.03, 0, 0.18), radius=0.02)
        self.assertEqual(part.left, self.fibres()['bed'])
        self.assertGreater(part.gone, 0)
        self.surgeon.detach('bed')
        self.assertEqual({more.name, world.name}, set(self.fibres()))
        self.surgeon.reset()
        self.assertEqual({'bed'}, set(self.fibres()))

    def test_wrong_requests_change_nothing(self):
        before = self.surgeon.hash()
        good = {'body': 'gallbladder', 'other': 'liver', 'stiffness': 1e5, 'distance': 0.01}
        for wrong, code in (({'stiffness': NAN}, ErrorCode.INVALID_ARGUMENT), ({'stiffness': 0.0}, ErrorCode.INVALID_ARGUMENT),
                            ({'distance': -1.0}, ErrorCode.INVALID_ARGUMENT), ({'strength': -1.0}, ErrorCode.INVALID_ARGUMENT),
                            ({'radius': NAN}, ErrorCode.INVALID_ARGUMENT), ({'centre': (NAN, 0, 0)}, ErrorCode.INVALID_ARGUMENT),
                            ({'other': 'spleen'}, ErrorCode.UNKNOWN_NAME), ({'other': 'gallbladder'}, ErrorCode.INVALID_ARGUMENT),
                            ({'body': ''}, ErrorCode.INVALID_ARGUMENT), ({'name': 'a b'}, ErrorCode.INVALID_ARGUMENT),
                            ({'name': 'bed'}, ErrorCode.DUPLICATE_NAME), ({'distance': 1e-4}, ErrorCode.MISSED),
                            ({'radius': 0.01, 'centre': (5, 5, 5)}, ErrorCode.MISSED),
                            ({'radius': 0.1, 'frame': 'lab'}, ErrorCode.UNKNOWN_NAME)):
            with self.assertRaises(Refused, msg=str(wrong)) as refused:
                self.surgeon.attach(**{**good, **wrong})
            self.assertEqual(code, refused.exception.code, refused.exception.message)
        for wrong in ({'name': 'ligament'}, {'name': ''}, {'name': 'bed', 'radius': NAN},
                      {'name': 'bed', 'centre': (9, 9, 9), 'radius': 0.1}):
            with self.assertRaises(Refused, msg=str(wrong)):
                self.surgeon.detach(**wrong)
        self.refused(['ligament', 'bed'], 'detach', name='ligament')
        self.refused(['0.003', 'apart'], 'attach', body='gallbladder', other='liver', stiffness=1e5, distance=1e-4)
        self.refused(['centre.y', 'nan'], 'attach', body='gallbladder', other='liver', stiffness=1e5, distance=0.01,
                     centre=Point(0, NAN, 0))
        self.assertEqual(before, self.surgeon.hash())

    def test_the_blade_between_cuts_them_and_undo_brings_them_back(self):
        whole = self.fibres()['bed']
        answer = self.surgeon.cut(pivot=(-0.1, 0, 0.1785), reach=(1, 0, 0), normal=(0, 0, 1), length=0.1, width=0.2)
        self.assertIn('fibres of \'bed\'', answer.message)
        self.assertEqual([], list(answer.new_bodies))
        self.assertLess(self.fibres()['bed'], whole)
        self.surgeon.undo()
        self.assertEqual(whole, self.fibres()['bed'])

    def test_a_pull_tears_it_off_with_events(self):
        heard = []
        subscriber = rospy.Subscriber('/deformer/events', Event, heard.append, queue_size=100)
        while not connected(subscriber):
            rospy.sleep(0.01)
        pick = self.surgeon.pick((-0.03, 0, 0.15), body='gallbladder', stiffness=2000)
        for k in range(60):
            self.surgeon.move(pick.pick_id, (-0.03, 0, 0.15 - 0.002 * k))
            self.surgeon.step(10)
        self.assertEqual(0, self.fibres()['bed'])
        self.assertEqual([], self.shown())
        torn = []
        while len(torn) < 2 and not rospy.is_shutdown():
            torn = [event.text for event in heard if event.type == Event.TORN]
            rospy.sleep(0.01)
        self.assertIn('begins', torn[0])
        self.assertIn('no fibre is left', torn[1])


if __name__ == '__main__':
    run('attach', AttachTest)
