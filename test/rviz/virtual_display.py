"""A display that nobody sees, rviz on it, and pictures of what it shows."""
import contextlib
import ctypes
import os
import re
import signal
import subprocess
import tempfile
import time

import numpy


class _CursorImage(ctypes.Structure):
    """XFixesCursorImage, version 2."""
    _fields_ = [('x', ctypes.c_short), ('y', ctypes.c_short), ('width', ctypes.c_ushort), ('height', ctypes.c_ushort),
                ('xhot', ctypes.c_ushort), ('yhot', ctypes.c_ushort), ('serial', ctypes.c_ulong),
                ('pixels', ctypes.POINTER(ctypes.c_ulong)), ('atom', ctypes.c_ulong), ('name', ctypes.c_char_p)]


RVIZ_CRASHED = re.compile(r'\[rviz-\d+\] process has died \[pid \d+, exit code -11')


class VirtualDisplay:
    def __init__(self, width=1280, height=900):
        read_end, write_end = os.pipe()
        # -noreset: without it the server starts anew whenever its last client leaves, a picture's `import` for example,
        # and who connects at that moment is thrown out.
        self.server = subprocess.Popen(
            ['Xvfb', '-displayfd', str(write_end), '-screen', '0', '%dx%dx24' % (width, height), '+extension', 'GLX',
             '-nolisten', 'tcp', '-noreset'], pass_fds=[write_end], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(write_end)
        with os.fdopen(read_end) as pipe:
            number = pipe.readline().strip()
        if not number:
            raise RuntimeError('Xvfb did not start')
        self.environment = dict(os.environ, DISPLAY=':' + number)

    def start_rviz(self, command, shown, seconds=90):
        """A roslaunch with rviz, once `shown()`. As its windows come up rviz can die of an X event for a window that is
        gone (in QGuiApplicationPrivate::processNativeEvent, once in some hundred starts): then it is started once more."""
        for attempt in range(2):
            with tempfile.NamedTemporaryFile() as output:
                process = subprocess.Popen(command, env=self.environment, stdout=output, stderr=subprocess.STDOUT)

                def crashed():
                    with open(output.name, errors='replace') as text:
                        return RVIZ_CRASHED.search(text.read())
                if wait_until(lambda: crashed() or shown(), seconds) and not crashed():
                    return process
                again = attempt == 0 and crashed()
                stop(process)
                with open(output.name, errors='replace') as text:
                    print(text.read()[-4000:])
            if not again:
                raise AssertionError('rviz did not show its view')
            print('rviz crashed as it started, and is started once more')

    def screenshot(self):
        """height x width x 3 bytes."""
        data = subprocess.run(['import', '-window', 'root', '-depth', '8', 'ppm:-'], env=self.environment,
                              stdout=subprocess.PIPE, check=True).stdout
        magic, size, depth, pixels = data.split(b'\n', 3)
        assert magic == b'P6' and depth == b'255', (magic, size, depth)
        width, height = (int(word) for word in size.split())
        return numpy.frombuffer(pixels, dtype=numpy.uint8).reshape(height, width, 3)

    def xdotool(self, *words):
        subprocess.run(['xdotool'] + [str(word) for word in words], env=self.environment, check=True)

    def cursor(self):
        """What the mouse's cursor looks like: its size and pixels. (A screenshot has no cursor.)"""
        x11, fixes = ctypes.CDLL('libX11.so.6'), ctypes.CDLL('libXfixes.so.3')
        x11.XOpenDisplay.restype = ctypes.c_void_p
        fixes.XFixesGetCursorImage.restype = ctypes.POINTER(_CursorImage)
        connection = ctypes.c_void_p(x11.XOpenDisplay(self.environment['DISPLAY'].encode()))
        if not connection:
            raise RuntimeError('the display cannot be opened')
        major, minor = ctypes.c_int(), ctypes.c_int()
        fixes.XFixesQueryExtension(connection, ctypes.byref(major), ctypes.byref(minor))
        image = fixes.XFixesGetCursorImage(connection)
        shape = image.contents
        look = shape.width, shape.height, tuple(shape.pixels[i] for i in range(shape.width * shape.height))
        x11.XFree(image)
        x11.XCloseDisplay(connection)
        return look

    def save(self, file):
        subprocess.run(['import', '-window', 'root', file], env=self.environment, check=True)

    @contextlib.contextmanager
    def stalled(self):
        """It takes no picture: programs wait in the middle of their drawing."""
        self.server.send_signal(signal.SIGSTOP)
        try:
            yield
        finally:
            self.server.send_signal(signal.SIGCONT)

    def close(self):
        self.server.terminate()
        self.server.wait()


class Mouse:
    """A hand on the display's mouse and keyboard. Places are (row, column)."""

    STEP = 8  # [px] between two places of a drag: a hand does not jump

    def __init__(self, display):
        self.display = display
        self.place = None

    def move(self, place):
        row, column = int(place[0]), int(place[1])
        if self.place is None:
            self.display.xdotool('mousemove', column, row)
        else:
            count = max(1, int(max(abs(row - self.place[0]), abs(column - self.place[1])) / self.STEP))
            for i in range(1, count + 1):
                self.display.xdotool('mousemove', round(self.place[1] + (column - self.place[1]) * i / count),
                                     round(self.place[0] + (row - self.place[0]) * i / count))
                time.sleep(0.02)
        self.place = (row, column)
        time.sleep(0.1)

    def down(self, button=1):
        self.display.xdotool('mousedown', button)

    def up(self, button=1):
        self.display.xdotool('mouseup', button)

    def click(self, button=1):
        self.display.xdotool('click', button)

    def wheel(self, notches):
        """Above 0: away from the viewer."""
        for _ in range(abs(notches)):
            self.display.xdotool('click', 4 if notches > 0 else 5)
            time.sleep(0.05)

    def key(self, name):
        self.display.xdotool('key', name)

    def key_down(self, name):
        self.display.xdotool('keydown', name)

    def key_up(self, name):
        self.display.xdotool('keyup', name)


def stop(process):
    """rviz leaves a stale node behind after SIGTERM."""
    process.send_signal(signal.SIGINT)
    try:
        process.wait(15)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def wait_until(condition, seconds, pause=0.5):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(pause)
    return condition()
