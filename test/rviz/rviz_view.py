"""Where points of the world are in a picture of rviz: for its orbit camera, whose settings are in the configuration."""
import os

import numpy
import rospkg
import yaml

BACKGROUND = (34, 38, 44)


def configured_view(scene):
    """The camera of config/rviz/SCENE.rviz."""
    file = os.path.join(rospkg.RosPack().get_path('meshless_surgery'), 'config', 'rviz', scene + '.rviz')
    with open(file) as text:
        return yaml.safe_load(text)['Visualization Manager']['Views']['Current']


def view_rectangle(picture):
    """The 3D view: rows and columns that hold its background."""
    inside = (picture == BACKGROUND).all(axis=2)
    rows, columns = numpy.where(inside.sum(axis=1) > 50)[0], numpy.where(inside.sum(axis=0) > 50)[0]
    if len(rows) == 0 or len(columns) == 0:
        return None
    return rows[0], rows[-1] + 1, columns[0], columns[-1] + 1


def camera_axes(view):
    """The eye, and the unit vectors to the right, up and back towards it."""
    focus = numpy.array([view['Focal Point'][axis] for axis in 'XYZ'])
    yaw, pitch, distance = view['Yaw'], view['Pitch'], view['Distance']
    back = numpy.array([numpy.cos(yaw) * numpy.cos(pitch), numpy.sin(yaw) * numpy.cos(pitch), numpy.sin(pitch)])
    side = numpy.cross([0, 0, 1], back)
    side /= numpy.linalg.norm(side)
    return focus + distance * back, side, numpy.cross(back, side), back


def project(points, view, rectangle):
    """Pixels (row, column) of points seen by rviz's orbit camera, whose angle of view is the vertical one."""
    top, bottom, left, right = rectangle
    eye, side, up, back = camera_axes(view)
    relative = points - eye
    depth = -relative.dot(back)
    scale = 0.5 * (bottom - top) / numpy.tan(0.5 * view['Field of View'])
    columns = 0.5 * (left + right) + scale * relative.dot(side) / depth
    rows = 0.5 * (top + bottom) - scale * relative.dot(up) / depth
    return numpy.rint(numpy.stack([rows, columns], axis=1)).astype(int)


def ray_through(place, view, rectangle):
    """Of the camera, through a pixel (row, column): from where, and which way."""
    top, bottom, left, right = rectangle
    eye, side, up, back = camera_axes(view)
    scale = 0.5 * (bottom - top) / numpy.tan(0.5 * view['Field of View'])
    return eye, ((place[1] - 0.5 * (left + right)) * side - (place[0] - 0.5 * (top + bottom)) * up) / scale - back


def axes(pose):
    """Of a pose: its x, y and z, as rows."""
    q = pose.orientation
    x = numpy.array([1 - 2 * (q.y ** 2 + q.z ** 2), 2 * (q.x * q.y + q.w * q.z), 2 * (q.x * q.z - q.w * q.y)])
    z = numpy.array([2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x), 1 - 2 * (q.x ** 2 + q.y ** 2)])
    return numpy.array([x, numpy.cross(z, x), z])
