"""How the motion of a device leads an instrument. Poses are pairs of a position (x, y, z) and a quaternion (x, y, z, w)."""
import math

from meshless_surgery.poses import cross, quaternion_of_axes

AXES = {'right': (1.0, 0.0, 0.0), 'left': (-1.0, 0.0, 0.0), 'away': (0.0, 1.0, 0.0), 'back': (0.0, -1.0, 0.0),
        'up': (0.0, 0.0, 1.0), 'down': (0.0, 0.0, -1.0)}
NO_TURN = (0.0, 0.0, 0.0, 1.0)


def product(a, b):
    """The turn by b, then by a."""
    return (a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
            a[3] * b[1] + a[1] * b[3] + a[2] * b[0] - a[0] * b[2],
            a[3] * b[2] + a[2] * b[3] + a[0] * b[1] - a[1] * b[0],
            a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2])


def inverse(q):
    return (-q[0], -q[1], -q[2], q[3])


def unit(q):
    """None: it is no quaternion."""
    length = math.sqrt(sum(c * c for c in q))
    return tuple(c / length for c in q) if math.isfinite(length) and length > 1e-6 else None


def turned(q, v):
    return product(product(q, (v[0], v[1], v[2], 0.0)), inverse(q))[:3]


def of_turn(turn):
    """Of a vector along the axis, as long as the angle [rad]."""
    angle = math.sqrt(sum(c * c for c in turn))
    share = 0.5 if angle < 1e-9 else math.sin(0.5 * angle) / angle
    return unit((share * turn[0], share * turn[1], share * turn[2], math.cos(0.5 * angle)))


def of_rpy(roll, pitch, yaw):
    """As a scene's rpy [rad]: about x, then y, then z."""
    return product(of_turn((0.0, 0.0, yaw)), product(of_turn((0.0, pitch, 0.0)), of_turn((roll, 0.0, 0.0))))


def of_axes(words):
    """The turn of a device's axes, such as 'right up back', into those of who looks at the scene: x right, y away, z up."""
    names = words.split()
    unknown = [name for name in names if name not in AXES]
    if len(names) != 3 or unknown:
        raise ValueError("axes are '%s'; accepted: three of %s" % (words, ', '.join(AXES)))
    x, y, z = (AXES[name] for name in names)
    if cross(x, y) != z:
        raise ValueError("axes are '%s', which are no right-handed frame; accepted: such as 'right away up'" % words)
    return quaternion_of_axes(x, y, z)


class HandMap:
    """The instrument goes by the device's motion, from where both were when the hand took hold: `scale` times as far, and
    turned as much. `axes` are the device's, in the view of the trainee; `view` is the turn of that view in the world."""

    def __init__(self, axes='right away up', view=NO_TURN, scale=1.0):
        self._turn = product(view, of_axes(axes))
        self._scale = scale
        self._from = None

    @property
    def holds(self):
        return self._from is not None

    def hold(self, device, instrument):
        self._from = (device, instrument)

    def release(self):
        self._from = None

    def instrument(self, device):
        """Where it goes as the device is there."""
        (begin, begin_turn), (place, orientation) = self._from
        way = turned(self._turn, tuple(self._scale * (now - then) for now, then in zip(device[0], begin)))
        by = product(device[1], inverse(begin_turn))
        by = product(product(self._turn, by), inverse(self._turn))
        return tuple(p + w for p, w in zip(place, way)), unit(product(by, orientation))

    def to_device(self, vector):
        """Of the world, in the device's axes."""
        return turned(inverse(self._turn), vector)

    def to_world(self, vector):
        return turned(self._turn, vector)


def limited(force, most):
    """No longer than that."""
    length = math.sqrt(sum(c * c for c in force))
    return force if length <= most else tuple(most / length * c for c in force)
