"""A display that nobody sees, rviz on it, and pictures of what it shows."""
import os
import signal
import subprocess
import time

import numpy


class VirtualDisplay:
    def __init__(self, width=1280, height=900):
        read_end, write_end = os.pipe()
        self.server = subprocess.Popen(
            ['Xvfb', '-displayfd', str(write_end), '-screen', '0', '%dx%dx24' % (width, height), '+extension', 'GLX',
             '-nolisten', 'tcp'], pass_fds=[write_end], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(write_end)
        with os.fdopen(read_end) as pipe:
            number = pipe.readline().strip()
        if not number:
            raise RuntimeError('Xvfb did not start')
        self.environment = dict(os.environ, DISPLAY=':' + number)

    def start(self, command):
        return subprocess.Popen(command, env=self.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def screenshot(self):
        """height x width x 3 bytes."""
        data = subprocess.run(['import', '-window', 'root', '-depth', '8', 'ppm:-'], env=self.environment,
                              stdout=subprocess.PIPE, check=True).stdout
        magic, size, depth, pixels = data.split(b'\n', 3)
        assert magic == b'P6' and depth == b'255', (magic, size, depth)
        width, height = (int(word) for word in size.split())
        return numpy.frombuffer(pixels, dtype=numpy.uint8).reshape(height, width, 3)

    def save(self, file):
        subprocess.run(['import', '-window', 'root', file], env=self.environment, check=True)

    def close(self):
        self.server.terminate()
        self.server.wait()


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
