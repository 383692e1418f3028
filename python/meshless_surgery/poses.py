"""Poses of blades, from the directions that a surgeon thinks in."""
import math

from geometry_msgs.msg import Point, PoseStamped, Quaternion, Vector3


def numbers(name, value, what='three numbers x, y, z'):
    """As floats; raises ValueError with the name where it is not as many numbers as `what` begins with."""
    count = ('one', 'two', 'three', 'four').index(what.split()[0]) + 1
    try:
        given = tuple(value)
        if len(given) == count and not any(isinstance(each, (str, bytes)) for each in given):
            return tuple(float(each) for each in given)
    except (TypeError, ValueError):
        pass
    raise ValueError('%s is %s; accepted: %s' % (name, repr(value)[:60], what))


def point(name, value):
    return Point(*numbers(name, value))


def vector(name, value):
    return Vector3(*numbers(name, value))


def rotation(name, value):
    return Quaternion(*numbers(name, value, 'four numbers x, y, z, w of a quaternion'))


def normalised(v):
    length = math.sqrt(sum(c * c for c in v))
    return tuple(c / length for c in v)


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def quaternion_of_axes(x, y, z):
    """Quaternion (xyzw) of the rotation whose columns are three orthonormal axes."""
    m = [[x[i], y[i], z[i]] for i in range(3)]
    trace = m[0][0] + m[1][1] + m[2][2]
    if trace > 0:
        s = 2.0 * math.sqrt(1.0 + trace)
        return ((m[2][1] - m[1][2]) / s, (m[0][2] - m[2][0]) / s, (m[1][0] - m[0][1]) / s, 0.25 * s)
    i = max(range(3), key=lambda k: m[k][k])
    j, k = (i + 1) % 3, (i + 2) % 3
    s = 2.0 * math.sqrt(1.0 + m[i][i] - m[j][j] - m[k][k])
    q = [0.0] * 4
    q[i] = 0.25 * s
    q[j] = (m[j][i] + m[i][j]) / s
    q[k] = (m[k][i] + m[i][k]) / s
    q[3] = (m[k][j] - m[j][k]) / s
    return tuple(q)


def pose_stamped(position, orientation=(0.0, 0.0, 0.0, 1.0), frame=''):
    pose = PoseStamped()
    pose.header.frame_id = frame
    pose.pose.position = point('position', position)
    pose.pose.orientation = rotation('orientation', orientation)
    return pose


def at_an_angle(**directions):
    """Raises ValueError where two directions, given by their names, span no plane."""
    (one, a), (other, b) = ((name, numbers(name, value)) for name, value in directions.items())
    if not sum(c * c for c in cross(a, b)) > 1e-18 * sum(c * c for c in a) * sum(c * c for c in b):
        raise ValueError('%s is %s and %s is %s; accepted: two directions at an angle' % (one, a, other, b))


def blades_pose(pivot, reach, normal, frame=''):
    """Pose of blades that pivot at a point, reach along `reach` and cut the plane of `normal`."""
    at_an_angle(reach=reach, normal=normal)
    z = normalised(normal)
    y = normalised(cross(z, reach))
    return pose_stamped(numbers('pivot', pivot), quaternion_of_axes(cross(y, z), y, z), frame)


def blade_pose(start, along, out, frame=''):
    """Pose of a blade whose edge outside of the tissue runs from `start` along `along`; `out` points out of the tissue."""
    at_an_angle(along=along, out=out)
    x = normalised(along)
    y = normalised(cross(cross(x, out), x))
    return pose_stamped(numbers('start', start), quaternion_of_axes(x, y, cross(x, y)), frame)
