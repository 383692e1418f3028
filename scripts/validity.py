#!/usr/bin/env python3
"""Compares the reports of two groups of trainees: how far their scores are apart, how well a run tells a trainee, and the pass mark
between the groups."""
import argparse
import os
import sys
import unicodedata

from meshless_surgery import curves, validity


def main():
    home = os.environ.get('ROS_HOME') or os.path.join(os.path.expanduser('~'), '.ros')
    parser = argparse.ArgumentParser(description=__doc__, epilog='Exit status: 0; 2 where there is no report, or an option is wrong.')
    parser.add_argument('folder', nargs='?', default=os.path.join(home, 'meshless_surgery', 'reports'),
                        help='of reports, a folder each (default: %(default)s)')
    parser.add_argument('--novices', nargs='+', required=True, metavar='NAME', help='trainees, at least two')
    parser.add_argument('--experts', nargs='+', required=True, metavar='NAME', help='others, at least two')
    parser.add_argument('--task', help='this task alone')
    parser.add_argument('--out', default='validity.html', help='the page (default: %(default)s)')
    wish = parser.parse_args()
    if not os.path.isdir(wish.folder):
        parser.error('there is no folder %s' % wish.folder)
    runs, faults = curves.read(wish.folder)
    for name, why in faults:
        print('%s is passed over: %s' % (name, why), file=sys.stderr)
    groups = [{unicodedata.normalize('NFC', name) for name in names} for names in (wish.novices, wish.experts)]
    if groups[0] & groups[1]:
        parser.error('%s: in both groups; accepted: in one' % ', '.join(sorted(groups[0] & groups[1])))
    runs = [run for run in runs if wish.task in (None, run.task) and run.trainee in groups[0] | groups[1]]
    for name in sorted((groups[0] | groups[1]) - {run.trainee for run in runs}):
        parser.error("there is no run of '%s'" % name)
    try:
        found = validity.compare(runs, *groups)
        with open(wish.out, 'w', encoding='utf-8') as file:
            file.write(validity.page(found))
    except (OSError, ValueError) as fault:
        parser.error(str(fault))
    for task, entry in found.items():
        print('%s: %s' % (task, validity.sentence(entry)))
        for name, (worse, better, g) in sorted(entry['metrics'].items(), key=lambda item: -item[1][2]):
            print('  %-22s novices %10.4g  experts %10.4g  g %6.2f' % (name, worse, better, g))
    print('page: %s' % os.path.abspath(wish.out))


if __name__ == '__main__':
    main()
