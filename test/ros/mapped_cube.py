"""Where scenes/mapped.obj lays scenes/pixels.png."""
import numpy

PIXELS = numpy.array([[[255, 0, 0], [0, 255, 0], [0, 0, 255], [255, 255, 0]], [[0] * 3, [80] * 3, [160] * 3, [255] * 3]])  # of pixels.png
SIZE = 0.1  # [m]
PIXEL_OF_SIDE = ((0, 0), (1, 0), (2, 0), (1, 1), (2, 1), (3, 0))  # column and row; sides: -x +x -y +y -z +z


def seen_at(x, y):
    """The colour of pixels.png there, in its widths from the lower left corner on: between the middles of pixels."""
    rows, columns = PIXELS.shape[:2]
    at = [(-y * columns - 0.5), (x * columns - 0.5)]
    first = [int(numpy.floor(a)) for a in at]
    share = [a - f for a, f in zip(at, first)]
    return sum((share[0] if down else 1 - share[0]) * (share[1] if right else 1 - share[1]) *
               PIXELS[(first[0] + down) % rows, (first[1] + right) % columns] for down in (0, 1) for right in (0, 1))


def laid_at(side, place):
    """u and v of a place [m] of the cube on that side."""
    column, row = PIXEL_OF_SIDE[side]
    right, up = numpy.roll(place, -(side // 2) - 1)[:2] / SIZE + 0.5
    return numpy.array([(column + 0.1 + 0.8 * right) / 4.0, 1.0 - (row + 0.1 + 0.8 * (1.0 - up)) / 2.0])
