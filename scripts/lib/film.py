"""The film and the pictures of docs/images: each shot has a scene, a camera and what hands do. The world is stepped, and a
picture is taken once rviz has drawn the step: so the film is as smooth on a slow machine. Run by scripts/film."""
import argparse
import contextlib
import os
import socket
import subprocess
import sys
import tempfile
import time

import numpy
import yaml

CHECKOUT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.realpath(__file__))))
sys.path[:0] = [os.path.join(CHECKOUT, 'scripts'), os.path.join(CHECKOUT, 'test', 'rviz')]
IMAGES = os.path.join(CHECKOUT, 'docs', 'images')

PICTURES = 12  # a second of the film
LARGEST = 3e6  # [bytes]
WINDOW = 760, 640  # [px]
CHANGED, STANDS = 2.0, 10.0  # [s] until a step is drawn, by software, at most
SETTLED = 2.0  # [s] until what is new is loaded and drawn
ENDOSCOPE = '-0.01 -0.17 0.10 1.57 -0.12 0 world endoscope'

LAUNCH = '''<launch>
  <node name="deformer" pkg="meshless_surgery" type="deformer_node">
    <param name="scene" value="%s"/><param name="paused" value="true"/><param name="tools/silence" value="0.0"/>
  </node>
  <node name="scene" pkg="tf2_ros" type="static_transform_publisher" args="0 0 0 0 0 0 world scene"/>
  <node name="endoscope" pkg="tf2_ros" type="static_transform_publisher" args="%s"/>
  <node name="rviz" pkg="rviz" type="rviz" args="-d %s -f world"/>
</launch>
'''


def between(start, end, count):
    """`count` places on the way, at first and at last slowly."""
    for share in numpy.linspace(0.0, 1.0, count + 1)[1:]:
        yield tuple(numpy.array(start) + (3.0 - 2.0 * share) * share * share * (numpy.array(end) - numpy.array(start)))


def place(point):
    return numpy.array((point.x, point.y, point.z))


def resection(surgeon):
    """The lobe with the lump is drawn aside, cut along the plan and taken away."""
    from meshless_surgery.poses import blades_pose, cross, normalised, quaternion_of_axes
    from play_resection import carried_over
    surgeon.live(3.0)
    tip = min(surgeon.body('liver').surface.vertices, key=lambda v: v.x)
    pick = surgeon.pick((tip.x, tip.y, tip.z), body='liver')
    reach = normalised((0.88, 0.32, -0.35))  # the grasper comes from the left
    side = normalised(cross((0, 0, 1), reach))
    turn = quaternion_of_axes(reach, side, cross(reach, side))
    hand = place(pick.position)
    with surgeon.stream('pick') as grasper:
        def drawn(to, count):
            nonlocal hand
            for at in between(hand, to, count):
                grasper.move(at, turn)
                yield
            hand = numpy.array(to)
        for _ in range(4):
            grasper.move(hand, turn)
            yield
        yield from drawn(hand + (-0.012, -0.01, 0.03), 18)
        point, normal = carried_over(surgeon.body('liver', rest=True).surface.vertices, surgeon.body('liver').surface.vertices)
        top = max(v.z for v in surgeon.body('liver').surface.vertices if abs((place(v) - point).dot(normal)) < 0.006)
        down = numpy.array((0.0, 0.35, -1.0))
        down -= down.dot(normal) * normal
        down /= numpy.linalg.norm(down)
        at = point + down * ((top - point[2]) / down[2] - 0.035)
        with surgeon.stream('scissors') as scissors:
            def cutting(pivot, angle):
                pose = blades_pose(pivot, down, normal).pose
                q = pose.orientation
                scissors.move(tuple(pivot), (q.x, q.y, q.z, q.w))
                scissors.jaw(angle)
                grasper.move(hand, turn)
            for pivot in between(at - 0.10 * down, at, 16):
                cutting(pivot, 0.7)
                yield
            for angle in numpy.linspace(0.7, 0.0, 9):
                cutting(at, angle)
                yield
            for pivot in between(at, at - 0.16 * down, 8):
                cutting(pivot, 0.0)
                grasper.move(hand, turn)
                yield
        surgeon.lift_scissors()
        yield from drawn(hand + (-0.05, -0.02, 0.015), 24)
        for _ in range(8):
            grasper.move(hand, turn)
            yield


def incision(surgeon):
    """Skin, opened and spread by two graspers."""
    surgeon.live(1.0)
    top = max(v.z for v in surgeon.body('skin').surface.vertices if abs(v.x) < 0.04 and abs(v.y) < 0.003)
    surgeon.incise(start=(-0.04, 0, top + 0.01), along=(1, 0, 0), out=(0, 0, 1), length=0.08, depth=0.023)
    for side in (-1, 1):
        pick = surgeon.pick((0, 0.006 * side, top), body='skin', stiffness=400)
        surgeon.lock(pick.pick_id, (pick.position.x, pick.position.y + 0.016 * side, pick.position.z + 0.004))
    surgeon.live(2.0)
    yield


def abdomen(surgeon):
    surgeon.live(2.0)
    yield


def vessel(surgeon):
    """Two clips, and the scissors between them."""
    from meshless_surgery.poses import blades_pose
    surgeon.live(0.5)
    for x in (-0.006, 0.006):
        surgeon.clip((x, 0, 0.05), (0, 0, 1), width=0.003)
    surgeon.live(0.5)
    q = blades_pose((0, 0, 0), (0, 0.7, -0.7), (1, 0, 0)).pose.orientation
    with surgeon.stream('scissors') as scissors:
        scissors.move((0.0, -0.022, 0.071), (q.x, q.y, q.z, q.w))
        scissors.jaw(0.5)
        yield


class Shot:
    def __init__(self, scene, hands, config=None, film=False, **view):
        self.scene, self.hands, self.config, self.film, self.view = scene, hands, config or scene, film, view


SHOTS = {
    'resection': Shot('resection', resection, film=True, Distance=0.30, **{'Focal Point': {'X': -0.02, 'Y': 0.0, 'Z': 0.07}}),
    'incision': Shot('incision', incision, Distance=0.22),
    'abdomen': Shot('abdomen', abdomen),
    'endoscope': Shot('abdomen', abdomen, 'endoscope'),
    'vessel': Shot('vessel', vessel, Distance=0.07),
}


def configuration(shot):
    """The scene's configuration without panels, tool bar and grid."""
    with open(os.path.join(CHECKOUT, 'config', 'rviz', shot.config + '.rviz')) as text:
        config = yaml.safe_load(text)
    config['Panels'] = []
    manager = config['Visualization Manager']
    manager['Global Options']['Background Color'] = '34; 38; 44'
    manager['Views']['Current'].update(shot.view)
    for display in manager['Displays']:
        if display['Class'] == 'rviz/Grid':
            display['Enabled'] = display['Value'] = False
    config['Window Geometry'] = {'Width': WINDOW[0], 'Height': WINDOW[1], 'X': 0, 'Y': 0, 'Hide Left Dock': True, 'Hide Right Dock': True}
    return config


@contextlib.contextmanager
def stage(shot):
    """Node and rviz with the shot's scene; what takes a picture."""
    from rviz_view import view_rectangle
    from virtual_display import VirtualDisplay, stop, wait_until
    with tempfile.TemporaryDirectory() as folder, contextlib.closing(VirtualDisplay(*WINDOW)) as display:
        config, launch = (os.path.join(folder, name) for name in ('view.rviz', 'film.launch'))
        with open(config, 'w') as file:
            yaml.safe_dump(configuration(shot), file)
        with open(launch, 'w') as file:
            file.write(LAUNCH % (shot.scene, ENDOSCOPE, config))
        rectangle = None

        def shown():
            nonlocal rectangle
            picture = display.screenshot()
            rectangle = view_rectangle(picture)
            return rectangle is not None and rectangle[1] - rectangle[0] > 0.7 * WINDOW[1] and len(numpy.unique(picture.reshape(-1, 3), axis=0)) > 500
        process = display.start_rviz(['roslaunch', launch], shown)

        def view():
            top, bottom, left, right = rectangle
            return numpy.ascontiguousarray(display.screenshot()[top:bottom, left:right])
        last = view()

        def picture():
            """Once what is seen has changed, and changes no more; some steps change nothing."""
            nonlocal last
            before = last
            wait_until(lambda: (view() != before).any(), CHANGED, 0.05)
            last = view()

            def stands():
                nonlocal last
                earlier, last = last, view()
                return (earlier == last).all()
            wait_until(stands, STANDS, 0.1)
            return last
        try:
            yield picture
        finally:
            stop(process)


def convert(pictures, file, before=(), after=()):
    """By ImageMagick, with the options before and after the pictures."""
    with tempfile.TemporaryDirectory() as folder:
        names = []
        for number, picture in enumerate(pictures):
            names.append(os.path.join(folder, '%04d.ppm' % number))
            with open(names[-1], 'wb') as raw:
                raw.write(b'P6 %d %d 255\n' % (picture.shape[1], picture.shape[0]) + picture.tobytes())
        subprocess.run(['convert', *before, *names, *after, file], check=True)
    print('%s: %d pictures, %d bytes' % (file, len(pictures), os.path.getsize(file)), flush=True)


def write_film(pictures, file):
    for width, colours in ((480, 96), (440, 64), (400, 48), (320, 32)):
        convert(pictures, file, ('-delay', str(round(100 / PICTURES)), '-loop', '0'),
                ('-resize', '%dx' % width, '+dither', '-colors', str(colours), '-layers', 'Optimize'))
        if os.path.getsize(file) <= LARGEST:
            return
    raise SystemExit('%s has %d bytes; at most %d fit' % (file, os.path.getsize(file), LARGEST))


def take(name):
    from meshless_surgery import Surgeon
    shot = SHOTS[name]
    with stage(shot) as picture:
        surgeon = Surgeon()
        surgeon.stepped()
        rate, pictures = surgeon.info().step_rate, []
        for _ in shot.hands(surgeon):
            surgeon.step(round(rate / PICTURES))
            if shot.film:
                pictures.append(picture())
        time.sleep(SETTLED)
        pictures.append(picture())
    file = os.path.join(IMAGES, name)
    if shot.film:
        write_film(pictures, file + '.gif')
    convert(pictures[-1:], file + '.png', after=('-resize', '640x', '-colors', '256'))


def main():
    parser = argparse.ArgumentParser(prog='scripts/film', description=__doc__)
    parser.add_argument('names', nargs='*', metavar='NAME', help='of %s (default: all)' % ', '.join(SHOTS))
    names = parser.parse_args().names or list(SHOTS)
    for name in names:
        if name not in SHOTS:
            parser.error("there is no shot '%s'; accepted: %s" % (name, ', '.join(SHOTS)))
    with socket.socket() as free:
        free.bind(('127.0.0.1', 0))
        port = free.getsockname()[1]
    os.environ.update(ROS_MASTER_URI='http://127.0.0.1:%d' % port, ROS_IP='127.0.0.1')
    import rosgraph
    import rospy
    from virtual_display import stop, wait_until
    master = subprocess.Popen(['roscore', '-p', str(port)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        if not wait_until(rosgraph.is_master_online, 60):
            raise SystemExit('roscore did not start')
        rospy.init_node('film', disable_signals=True)
        for name in names:
            take(name)
    finally:
        stop(master)


if __name__ == '__main__':
    main()
