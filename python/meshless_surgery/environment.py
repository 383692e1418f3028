"""A task as an environment for programs that learn: Gymnasium's interface, and Gymnasium's classes where it is installed.

    environment = Environment('retract', hands=[('pick', (-0.05, -0.06, 0.10))], points=[('liver', (0, -0.08, 0.06))])
    observation, info = environment.reset(seed=1)
    observation, reward, terminated, truncated, info = environment.step(environment.action_space.sample())
    environment.close()

docs/reference/python.md says what is in an action, an observation and a reward.
"""
import importlib.util

import numpy

from meshless_surgery.errors import ErrorCode, Refused
from meshless_surgery.surgeon import Surgeon

KINDS = {'pick': 4, 'push': 3}  # numbers of an action


class PlainBox:
    """What of gymnasium.spaces.Box is needed where it is not installed."""

    def __init__(self, low, high, shape, dtype=numpy.float64):
        self.low, self.high = numpy.full(shape, low, dtype), numpy.full(shape, high, dtype)
        self.shape, self.dtype = tuple(shape), numpy.dtype(dtype)
        self.seed(None)

    def seed(self, seed=None):
        self._random = numpy.random.default_rng(seed)
        return [seed]

    def sample(self):
        """Even between bounds; of a space without bounds the normal distribution."""
        if numpy.isfinite(self.low).all() and numpy.isfinite(self.high).all():
            return self._random.uniform(self.low, self.high).astype(self.dtype)
        return self._random.normal(size=self.shape).astype(self.dtype)

    def contains(self, value):
        value = numpy.asarray(value)
        return value.shape == self.shape and bool(((value >= self.low) & (value <= self.high)).all())


if importlib.util.find_spec('gymnasium'):
    gymnasium = importlib.import_module('gymnasium')
    Base, Box = gymnasium.Env, gymnasium.spaces.Box
else:
    Base, Box = object, PlainBox


def potential(seen):
    """0 to 2: the stages that were met, and once all are the score, each 0 to 1. The default reward is by how much it has grown."""
    return seen.task.score / 100.0 + seen.task.stage / len(seen.task.stages)


class _Hand:
    """Where a hand is; of a pick also whether it holds tissue."""

    def __init__(self, kind, start):
        if kind not in KINDS:
            raise ValueError("a hand is '%s'; accepted: %s" % (kind, ', '.join(KINDS)))
        self.kind, self.start = kind, numpy.array(start, float)
        if self.start.shape != (3,) or not numpy.isfinite(self.start).all():
            raise ValueError('a hand starts at %s; accepted: a position of three numbers' % (start,))
        self.position, self.pick = self.start, None


class Environment(Base):
    """Time moves by step() alone, in lock step with the node, whose world is paused: the same seed and actions give the same
    observations, to the bit.

    `task`: a name of config/tasks, or a file. `node`: one that runs its scene already; empty: one of its own is started, with
    `parameters`. `hands`: ('pick' or 'push', where it starts) each. `points`: (body, place at rest) each; the particle nearest to
    it is observed. `steps` of the world are done for an action, in which a hand goes up to `move` [m] along each axis. A pick that
    closes takes the tissue within `reach` [m]. An episode is truncated after `horizon` actions. Hands start up to `spread` [m]
    beside their place, by the seed. `reward(before, after)` is of two answers of ~observe."""

    metadata = {'render_modes': []}

    def __init__(self, task, node='', hands=(('pick', (0.0, 0.0, 0.1)),), points=(), steps=4, move=0.002, reach=0.01, horizon=1000,
                 spread=0.0, reward=None, **parameters):
        for name, value in (('steps', steps), ('horizon', horizon)):
            if value != int(value) or not 1 <= value <= 100000:
                raise ValueError('%s is %s; accepted: 1 to 100000' % (name, value))
        for name, value, least in (('move', move, 1e-9), ('reach', reach, 1e-9), ('spread', spread, 0.0)):
            if not least <= value <= 1000.0:
                raise ValueError('%s is %s; accepted: %s to 1000 m' % (name, value, least))
        if node and parameters:
            raise ValueError('%s are parameters of a node that runs already; accepted: none with node' % ', '.join(parameters))
        self._hands = [_Hand(kind, start) for kind, start in hands]
        if not self._hands:
            raise ValueError('there are no hands; accepted: at least one')
        if sum(hand.kind == 'push' for hand in self._hands) > 1:
            raise ValueError('there are several hands that push; accepted: one')
        self._task, self._steps, self._move, self._reach = task, int(steps), move, reach
        self._horizon, self._spread = int(horizon), spread
        self._reward = reward or (lambda before, after: potential(after) - potential(before))
        self._running, self._was_paused = None, True
        if node:
            self.surgeon = Surgeon(node)
            self._was_paused = self.surgeon.state().paused
        else:
            from meshless_surgery.testing import RunningScene
            self._running = RunningScene('', listens=False, task=task, **parameters)
            self.surgeon = self._running.surgeon
        if not self._was_paused:  # a task that runs by itself refuses a pause
            try:
                self.surgeon.stop_task()
            except Refused:
                pass  # none runs
        self.surgeon.stepped()
        self._name = None  # of the task, once it was started
        self._places = list(points)
        self._particles = []
        self._seen, self._over, self._done, self._closed = None, True, 0, False
        self.np_random = numpy.random.default_rng()
        self.action_space = Box(-1.0, 1.0, (sum(KINDS[hand.kind] for hand in self._hands),), dtype=numpy.float64)
        length = 10 * len(self._hands) + 4 * len(self._places) + 3
        self.observation_space = Box(-numpy.inf, numpy.inf, (length,), dtype=numpy.float64)

    def reset(self, *, seed=None, options=None):
        """The task from its start: (observation, info). Without a seed the numbers go on from the last one."""
        if options:
            raise ValueError('options are %s; accepted: none' % (options,))
        self._require_open()
        if seed is not None:
            self.np_random = numpy.random.default_rng(seed)
        stopped = not self._over and self._seen is not None and not self._seen.task.running
        if self._name is None or self._seen.task.task != self._name or stopped:
            self.surgeon.start_task(self._task, allow=['pause', 'slow'])
        else:
            self.surgeon.reset()
        self._particles = [self._nearest(body, place) for body, place in self._places]
        for hand in self._hands:
            hand.position = hand.start + self.np_random.uniform(-self._spread, self._spread, 3)
            hand.pick = None
            if hand.kind == 'push':
                self.surgeon.push(tuple(hand.position))
        self.surgeon.step(1)  # the task begins with it
        self._seen = self.surgeon.observe(self._particles)
        self._name = self._seen.task.task
        self._over, self._done = False, 0
        return self._observation(), self._info()

    def step(self, action):
        """(observation, reward, terminated: the task is done or failed, truncated, info)."""
        self._require_open()
        if self._over:
            raise RuntimeError('the episode is over; reset() begins another')
        action = numpy.asarray(action, float)
        if not self.action_space.contains(action):
            raise ValueError('an action is %s; accepted: %d numbers from -1 to 1' % (action, self.action_space.shape[0]))
        begin = 0
        for hand in self._hands:
            self._act(hand, action[begin:begin + KINDS[hand.kind]])
            begin += KINDS[hand.kind]
        self.surgeon.step(self._steps)
        before, self._seen = self._seen, self.surgeon.observe(self._particles)
        self._done += 1
        terminated = not self._seen.task.running
        truncated = not terminated and self._done >= self._horizon
        self._over = terminated or truncated
        return self._observation(), float(self._reward(before, self._seen)), terminated, truncated, self._info()

    def close(self):
        self._closed = True
        if self._running is not None:
            self._running.close()
            self._running = None
        elif self.surgeon.is_stepped and not self._was_paused:
            self.surgeon.runs()

    def render(self):
        """rviz shows the node."""

    def _require_open(self):
        if self._closed:
            raise RuntimeError('the environment was closed; accepted: another one')

    def _nearest(self, body, place):
        from sensor_msgs import point_cloud2
        rest = numpy.array(list(point_cloud2.read_points(self.surgeon.body(body, rest=True).particles, ('x', 'y', 'z'))))
        return body, int(numpy.linalg.norm(rest - numpy.array(place, float), axis=1).argmin())

    def _act(self, hand, action):
        hand.position = hand.position + self._move * action[:3]
        to = tuple(hand.position)
        if hand.kind == 'push':
            # It arrives with the last of the steps.
            way = numpy.linalg.norm(self._move * action[:3])
            self.surgeon.push(to, speed=max(way * self._seen.step / (self._seen.sim_time * self._steps), 1e-6))
            return
        if hand.pick is not None and action[3] <= 0.0:
            self.surgeon.release(hand.pick)
            hand.pick = None
        elif hand.pick is not None:
            self.surgeon.move(hand.pick, to)
        elif action[3] > 0.0:
            try:
                hand.pick = self.surgeon.pick(to, max_distance=self._reach).pick_id
                self.surgeon.move(hand.pick, to)
            except Refused as refused:
                if refused.code != ErrorCode.MISSED:
                    raise

    def _observation(self):
        picks = {pick.pick_id: pick for pick in self._seen.picks}
        numbers = []
        for hand in self._hands:
            works_at, force, holds = hand.position, (0.0, 0.0, 0.0), 0.0
            position = hand.position
            if hand.kind == 'push' and self._seen.push:
                position = works_at = _xyz(self._seen.push_position)
                force = _xyz(self._seen.push_force)
            elif hand.pick in picks:
                pick = picks[hand.pick]
                works_at, force, holds = _xyz(pick.position), _xyz(pick.force), 1.0
            else:
                hand.pick = None  # its body was removed
            for part in (position, works_at, force, (holds,)):
                numbers.extend(part)
        for point in self._seen.points:
            there = point.x == point.x  # NaN where its body is no more
            numbers.extend(_xyz(point) + (1.0,) if there else (0.0, 0.0, 0.0, 0.0))
        task = self._seen.task
        numbers += [self._seen.metrics.time, task.stage / len(task.stages), self._seen.metrics.held_for]
        return numpy.array(numbers, numpy.float64)

    def _info(self):
        """Without the metrics that have no value yet: NaN is not equal to itself."""
        task, metrics = self._seen.task, self._seen.metrics
        shown = {}
        if self._seen.plan:
            shown['plan'] = numpy.array([_xyz(point) for point in self._seen.plan]).reshape(-1, 2, 3)
        if self._seen.target.x == self._seen.target.x:
            shown['target'] = numpy.array(_xyz(self._seen.target))
        return {**shown, 'step': self._seen.step, 'time': metrics.time, 'score': task.score, 'stage': task.stage, 'stages': list(task.stages),
                'failed': task.failed, 'passed': task.passed,
                'metrics': {name: value for name, value in zip(metrics.names, metrics.values) if value == value}}


def _xyz(value):
    return (value.x, value.y, value.z)
