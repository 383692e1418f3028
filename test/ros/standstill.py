"""How long the processors stood still while a test moved a hand by the clock: who shares a host has less than all of their
time, and no test can tell a node that stood still from one that is slow. Run as a program, it is the watch."""
import os
import subprocess
import sys
import threading
import time

NOTED = 0.01     # [s] from here on a standstill is written down
LOOK = 0.002     # [s] between two looks
READY = 'ready'


class Standstill:
    """With it: one watch for each processor, in a process of its own. `holes`: (from, to) of time.time() [s]."""

    def __enter__(self):
        self.holes = []
        self.process = subprocess.Popen([sys.executable, os.path.abspath(__file__)], stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, text=True)
        if self.process.stdout.readline().strip() != READY:
            raise RuntimeError('the watch of the processors did not start')
        self.reader = threading.Thread(target=self._read, daemon=True)
        self.reader.start()
        return self

    def _read(self):
        for line in self.process.stdout:
            begin, end = line.split()
            self.holes.append((float(begin), float(end)))

    def __exit__(self, *unused):
        self.process.stdin.close()  # it ends with it, whatever becomes of this process
        self.process.wait()
        self.reader.join()
        self.process.stdout.close()

    def longest(self):
        return max([end - begin for begin, end in self.holes], default=0.0)

    def quiet(self, begin, end):
        """No processor stood still in this time."""
        return all(b > end or e < begin for b, e in self.holes)


def watch(processor):
    os.sched_setaffinity(0, {processor})  # of this thread
    before = time.time()
    while True:
        time.sleep(LOOK)
        now = time.time()
        if now - before > LOOK + NOTED:
            sys.stdout.write('%.6f %.6f\n' % (before, now))
            sys.stdout.flush()
        before = now


def main():
    print(READY, flush=True)
    for processor in os.sched_getaffinity(0):
        threading.Thread(target=watch, args=(processor,), daemon=True).start()
    sys.stdin.read()


if __name__ == '__main__':
    main()
