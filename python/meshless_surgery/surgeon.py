"""The services of a running deformer as methods."""
import contextlib
import math
import select
import time
from numbers import Real

import genpy
import rospy
from sensor_msgs.msg import PointCloud2
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger

from meshless_surgery.errors import Refused, Unanswered, Unreachable, need_topics, reaching
from meshless_surgery.goals import Goals
from meshless_surgery.msg import Info, State
from meshless_surgery.poses import blade_pose, blades_pose, numbers, point as point_of, pose_stamped, rotation, vector
from meshless_surgery.srv import (ApplyForce, Attach, AttachInstrument, Clip, Cut, Detach, DetachInstrument, GetBody, GetLoad, Hash, Incise, LoadState, Lock, MoveClamp, MovePick, Observe, Pick, Probe,
                                  Push, Release, Remove, Report, ResetBodies, SaveState, SetGravity, SetMaterial, SetPose, Spawn, SpawnCloud, StartTask, Step, Unclip)
from meshless_surgery.streams import TOOLS, ToolStream


class Surgeon:
    """Works on the tissue of one node. Metres, seconds, radians, quaternions x y z w.

    A method whose service answers success=false raises Refused with its message and code. Each request is sent once: where the
    connection breaks before the answer, Unanswered says how the world is now. `frame` is the tf frame of all positions,
    directions and poses, and each method takes another one; empty is the world frame."""

    def __init__(self, node='/deformer', timeout=30.0, frame=''):
        self.node = node
        self.timeout = timeout
        self.frame = frame
        self._proxies = {}
        self._goals = Goals(node, timeout)
        self._paused = False

    def call(self, name, service, /, **fields):
        """Any service of the node."""
        if name in self._proxies and self._ended(self._proxies[name]):
            del self._proxies[name]
        if name not in self._proxies:
            with reaching(self.node + '/' + name):
                rospy.wait_for_service(self.node + '/' + name, self.timeout)
            self._proxies[name] = rospy.ServiceProxy(self.node + '/' + name, service, persistent=True)
        try:
            reply = self._proxies[name](**fields)
        except (rospy.ServiceException, rospy.exceptions.TransportException) as error:
            del self._proxies[name]
            raise Unanswered('%s was sent once and not answered (%s); %s' % (name, error, self._now()))
        except (genpy.MessageException, rospy.exceptions.ROSSerializationException, AttributeError, TypeError) as error:
            # A value of another type than its field: nothing was sent. What rospy has made of the request stays with the
            # connection, and would come before the next one.
            del self._proxies[name]
            raise ValueError('%s was not sent: %s' % (name, error)) from error
        if not reply.success:
            raise Refused(name, reply.message, getattr(reply, 'error_code', None))
        return reply

    # Goals of the actions: as the methods without _async, which say what they take. They do not wait; each returns a Goal.
    def cut_async(self, *args, feedback=None, **named):
        return Surgeon.cut(_Sender(self, feedback), *args, **named)

    def incise_async(self, *args, feedback=None, **named):
        return Surgeon.incise(_Sender(self, feedback), *args, **named)

    def step_async(self, steps, feedback=None):
        return Surgeon.step(_Sender(self, feedback), steps)

    def spawn_async(self, *args, feedback=None, **named):
        return Surgeon.spawn(_Sender(self, feedback), *args, **named)

    @staticmethod
    def _ended(proxy):
        """The node has closed the connection since the last answer: nothing but its end can have come."""
        transport = proxy.transport
        return transport is not None and (transport.socket is None or bool(select.select([transport.socket], [], [], 0)[0]))

    def _now(self):
        try:
            state = self.state()
        except Unreachable:
            return 'the node does not answer either: does it run?'
        return 'the world is at step %d, with the bodies %s and %d springs' % (
            state.step, ', '.join(body.name for body in state.bodies) or 'none', len(state.picks))

    def _frame(self, frame):
        return self.frame if frame is None else frame

    def _header(self, frame):
        return Header(frame_id=self._frame(frame))

    # springs
    def pick(self, point, direction=(0, 0, 0), body='', stiffness=0.0, max_distance=0.0, frame=None):
        return self.call('pick', Pick, header=self._header(frame), point=point_of('point', point), direction=vector('direction', direction),
                         body=body, stiffness=stiffness, max_distance=max_distance)

    def move(self, pick_id, target, frame=None):
        return self.call('move_pick', MovePick, header=self._header(frame), pick_id=pick_id, target=point_of('target', target))

    def lock(self, pick_id, target=None, frame=None):
        return self.call('lock', Lock, header=self._header(frame), pick_id=pick_id, at_target=target is not None,
                         target=point_of('target', (0, 0, 0) if target is None else target))

    def release(self, pick_id):
        return self.call('release', Release, pick_id=pick_id)

    def clear(self):
        return self.call('clear_picks', Trigger)

    def probe(self, point, direction, frame=None):
        """What tissue a ray meets; Refused with MISSED where it meets none."""
        return self.call('probe', Probe, header=self._header(frame), point=point_of('point', point), direction=vector('direction', direction))

    # push sphere
    def push(self, position, radius=0.0, speed=0.0, frame=None):
        return self.call('push', Push, enable=True, radius=radius, pose=pose_stamped(position, frame=self._frame(frame)),
                         speed=speed)

    def lift_push(self):
        return self.call('push', Push, enable=False, radius=0.0, pose=pose_stamped((0, 0, 0)), speed=0.0)

    # scissors
    def cut(self, pivot, reach, normal, length=0.0, width=0.0, close_time=0.0, bodies=(), roughness=0.0, frame=None):
        """Severs what blades meet that pivot at a point, reach along `reach`, and lie in the plane of `normal`."""
        return self.call('cut', Cut, blades=blades_pose(pivot, reach, normal, self._frame(frame)), length=length,
                         width=width, close_time=close_time, roughness=roughness, bodies=list(bodies))

    def open_scissors(self):
        """Scissors that another thread closes open again; its cut is refused."""
        return self.call('open_scissors', Trigger)

    def lift_scissors(self):
        return self.call('lift_scissors', Trigger)

    # scalpel
    def incise(self, start, along, out, length, depth, bodies=(), frame=None):
        """Opens the tissue: the blade's edge that stays outside runs from `start` along `along`; `out` points out of it."""
        return self.call('incise', Incise, blade=blade_pose(start, along, out, self._frame(frame)), length=length,
                         depth=depth, bodies=list(bodies))

    def undo(self):
        """Back to before the last cut or incision."""
        return self.call('undo_cut', Trigger)

    # bodies
    def spawn(self, name='', file='', box=None, sphere=None, cylinder=None, position=(0, 0, 0),
              orientation=(0, 0, 0, 1), scale=0.0, material='', repair='', frame=None, units='',
              thickness=0.0, cavities=''):
        """A body from a file, or one of `box` (x, y, z), `sphere` radius, `cylinder` (height, radius), its lengths in `units`:
        m, cm, mm; empty: m. `repair` of a file's surface: none, mend, wrap; empty: mend. `thickness` [m] makes a layer of an open
        surface and a wall of a closed one. `cavities`: what fills them, as in a scene, such as '{pressure: 1000}'; empty: nothing."""
        shapes = {SolidPrimitive.BOX: box, SolidPrimitive.SPHERE: None if sphere is None else (sphere,),
                  SolidPrimitive.CYLINDER: cylinder}
        lengths = {SolidPrimitive.BOX: ('box', 'three numbers x, y, z'), SolidPrimitive.SPHERE: ('sphere', 'one number, the radius'),
                   SolidPrimitive.CYLINDER: ('cylinder', 'two numbers, height and radius')}
        given = [(kind, numbers(lengths[kind][0], sizes, lengths[kind][1])) for kind, sizes in shapes.items() if sizes is not None]
        if len(given) + bool(file) != 1:
            raise ValueError('%d shapes are given; accepted: one of file, box, sphere, cylinder' % (len(given) + bool(file)))
        primitive = SolidPrimitive(type=given[0][0], dimensions=given[0][1]) if given else SolidPrimitive()
        return self.call('spawn', Spawn, name=name, file=file, primitive=primitive, scale=scale, material=material,
                         repair=repair, units=units, thickness=thickness, cavities=cavities,
                         pose=pose_stamped(position, orientation, self._frame(frame)))

    def spawn_cloud(self, name='', cloud=None, topic='', timeout=0.0, scale=0.0, voxel=0.0, outliers=0.0, material=''):
        """A body from a sensor_msgs/PointCloud2, or from the next one of a topic."""
        return self.call('spawn_cloud', SpawnCloud, name=name, cloud=cloud or PointCloud2(), topic=topic, timeout=timeout,
                         scale=scale, voxel=voxel, outliers=outliers, material=material)

    def remove(self, name):
        return self.call('remove', Remove, name=name)

    def body(self, name, rest=False):
        """Surface, particles and measures."""
        return self.call('get_body', GetBody, name=name, rest=rest)

    def tissue_load(self, name, points=(), frame=None):
        """Elastic energy, the forces of what holds the body, strain and stress of the cells at `points`, or of all."""
        return self.call('get_load', GetLoad, header=self._header(frame), name=name, points=[point_of('points[%d]' % k, p) for k, p in enumerate(points)])

    def move_clamp(self, name, clamp=0, shift=(0, 0, 0), turn=(0, 0, 0, 1), time=0.0, frame=None):
        """Moves what entry `clamp` of `fixed` holds by `shift` and `turn` (x, y, z, w) from where it was put, in `time` seconds."""
        return self.call('move_clamp', MoveClamp, header=self._header(frame), name=name, clamp=clamp, shift=vector('shift', shift),
                         turn=rotation('turn', turn), time=time)

    def apply_force(self, name, force, time, centre=(0, 0, 0), radius=0.0, frame=None):
        """A `force` [N] on what lies in the sphere of `radius` about `centre` of the body's surface (0: on all of it), for `time`
        seconds. It stays on its tissue."""
        return self.call('apply_force', ApplyForce, header=self._header(frame), name=name, force=vector('force', force), time=time,
                         centre=point_of('centre', centre), radius=radius)

    def end_forces(self, name):
        """Of all that apply_force() has put on the body."""
        return self.call('apply_force', ApplyForce, name=name)

    def set_pose(self, name, position, orientation=(0, 0, 0, 1), frame=None):
        """Puts the body there, at rest and in its rest shape, with its cuts."""
        return self.call('set_pose', SetPose, name=name, pose=pose_stamped(position, orientation, self._frame(frame)))

    def set_material(self, body, yaml):
        return self.call('set_material', SetMaterial, body=body, yaml=yaml)

    # what holds bodies together
    def attach(self, body, other, stiffness, distance=0.0, strength=0.0, centre=(0, 0, 0), radius=0.0, name='', frame=None):
        """Joins two bodies, or a body and an obstacle or 'world', where they are within `distance`; only where the body's
        surface is in the sphere of `radius` about `centre`, if there is one. `stiffness` in N/m^3; `strength` in Pa, 0: it
        does not tear."""
        return self.call('attach', Attach, header=self._header(frame), name=name, body=body, other=other, distance=distance,
                         stiffness=stiffness, strength=strength, centre=point_of('centre', centre), radius=radius)

    def detach(self, name, centre=(0, 0, 0), radius=0.0, frame=None):
        """All of an attachment, or its fibres in a sphere."""
        return self.call('detach', Detach, header=self._header(frame), name=name, centre=point_of('centre', centre), radius=radius)

    def clip(self, point, direction, width=0.0, opening=0.0, body='', name='', frame=None):
        """Closes what is hollow at `point` between jaws that close along `direction`, across the vessel: `width` (0: 5 mm) along
        it, and up to `opening` (0: 20 mm) thick. It stays closed until unclip(name)."""
        return self.call('clip', Clip, header=self._header(frame), name=name, body=body, point=point_of('point', point),
                         direction=vector('direction', direction), width=width, opening=opening)

    def unclip(self, name):
        return self.call('unclip', Unclip, name=name)

    # the world
    def state(self):
        return self._said('state', State)

    def set_gravity(self, gravity, frame=None):
        """[m/s^2], until the next call or a reset."""
        return self.call('set_gravity', SetGravity, header=self._header(frame), gravity=vector('gravity', gravity))

    def reset_bodies(self, *bodies):
        """These bodies of the scene as it began, in place of what has become of them; without any: all of them."""
        return self.call('reset_bodies', ResetBodies, bodies=list(bodies))

    def info(self):
        """What runs there: scene, step rate, bodies."""
        return self._said('info', Info)

    def _said(self, topic, kind):
        topic = self.node + '/' + topic
        need_topics(topic)
        with reaching(topic):
            return rospy.wait_for_message(topic, kind, self.timeout)

    def reset(self):
        return self.call('reset', Trigger)

    def save(self, file):
        return self.call('save', SaveState, file=file)

    def load(self, file):
        return self.call('load', LoadState, file=file)

    def start_task(self, task, trainee='', allow=()):
        """`allow`: what this run allows beside what the task does, as 'undo' or 'pause' (docs/reference/tasks.md)."""
        return self.call('start_task', StartTask, task=task, trainee=trainee, allow=list(allow))

    def stop_task(self):
        return self.call('stop_task', Trigger)

    def report(self, name=''):
        return self.call('report', Report, name=name)

    def observe(self, points=()):
        """Task, metrics, tools, and the places of `points`, (body, particle) each, all of the same moment."""
        return self.call('observe', Observe, bodies=[body for body, _ in points], particles=[particle for _, particle in points])

    def hash(self):
        """A number for the whole state: equal for equal histories."""
        return self.call('hash', Hash).hash

    def stream(self, tool, frame=None):
        """The topics of a tool, or of an instrument by its name: a ToolStream."""
        jaws = tool == 'scissors'
        if tool not in TOOLS:
            asked, end = rospy.Time.now(), time.monotonic() + 1.0
            while True:  # one that has just been attached may not be in a state that was on the way
                state = self.state()
                types = {instrument.name: instrument.type for instrument in state.instruments}
                if tool in types or state.header.stamp >= asked or time.monotonic() > end:
                    break
            if tool not in types:
                raise ValueError("tool is '%s'; accepted: %s" % (tool, ', '.join((*TOOLS, *sorted(types)))))
            jaws = types[tool] in ('grasper', 'scissors', 'clip_applier')
        return ToolStream(self.node, tool, self._frame(frame), self.timeout, jaws)

    def attach_instrument(self, name, yaml, position, orientation=(0.0, 0.0, 0.0, 1.0), frame=None):
        """Takes an instrument into a hand, with its tip there: yaml as an entry of `instruments` of a scene, '{type: grasper}'."""
        return self.call('attach_instrument', AttachInstrument, name=name, yaml=yaml,
                         pose=pose_stamped(position, orientation, self._frame(frame)))

    def detach_instrument(self, name):
        return self.call('detach_instrument', DetachInstrument, name=name)

    # time
    def pause(self, paused=True):
        return self.call('pause', SetBool, data=paused)

    def step(self, steps):
        return self.call('step', Step, steps=steps)

    @contextlib.contextmanager
    def still(self):
        """Time stands still inside: what is measured before and after an act then differs by the act alone."""
        runs = not (self._paused or self.state().paused)
        if runs:
            self.pause(True)
        try:
            yield
        finally:
            if runs:
                self.pause(False)

    def live(self, seconds, rate=None):
        """Lets simulated time pass: while the world runs, by waiting for it; while it is paused, by stepping it."""
        if not (isinstance(seconds, Real) and 0.0 <= seconds < math.inf):
            raise ValueError('seconds is %r; accepted: a number, 0 or more' % (seconds,))
        state = self.state()
        end = state.sim_time + seconds
        while not (self._paused or state.paused):
            if state.sim_time >= end or rospy.is_shutdown():
                return
            state = self.state()
        self.step(max(1, int(round((end - state.sim_time) * (rate or self.info().step_rate)))))

    def stepped(self):
        """From here on time moves by live() and step() alone: the same on a slow machine as on a fast one."""
        self.pause(True)
        self._paused = True

    def runs(self):
        """Takes stepped() back."""
        self.pause(False)
        self._paused = False

    @property
    def is_stepped(self):
        return self._paused


class _Sender(Surgeon):
    """Sends as a goal what a Surgeon's method would call as a service."""

    def __init__(self, surgeon, feedback):
        super().__init__(surgeon.node, surgeon.timeout, surgeon.frame)
        self._goals, self._feedback = surgeon._goals, feedback

    def call(self, name, service, /, **fields):
        return self._goals.send(name, fields, self._feedback)
