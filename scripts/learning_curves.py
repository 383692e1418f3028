#!/usr/bin/env python3
"""Tabulates a folder of reports by task and trainee, draws learning curves, and derives pass marks from experts' runs."""
import argparse
import csv
import os
import sys
import unicodedata

from meshless_surgery import curves


def own_folder():
    home = os.environ.get('ROS_HOME') or os.path.join(os.path.expanduser('~'), '.ros')
    return os.path.join(home, 'meshless_surgery', 'reports')


def main():
    parser = argparse.ArgumentParser(description=__doc__, epilog='Exit status: 0; 2 where there is no report, or an option is wrong.')
    parser.add_argument('folder', nargs='?', default=own_folder(), help='of reports, a folder each (default: %(default)s)')
    parser.add_argument('--task', help='this task alone')
    parser.add_argument('--out', default='learning_curves.html', help='the page of curves (default: %(default)s)')
    parser.add_argument('--csv', help='a file for the table')
    parser.add_argument('--experts', nargs='+', default=[], metavar='NAME',
                        help="trainees whose runs give pass marks: they are printed as a task file's keys")
    wish = parser.parse_args()
    if not os.path.isdir(wish.folder):
        parser.error('there is no folder %s' % wish.folder)
    runs, faults = curves.read(wish.folder)
    for name, why in faults:
        print('%s is passed over: %s' % (name, why), file=sys.stderr)
    tasks = sorted({run.task for run in runs})
    runs = [run for run in runs if wish.task in (None, run.task)]
    undated = [run.folder for run in runs if run.date is None]
    if undated:
        print('%s: no date in the report; the time of the file is taken, which a copy changes' % ', '.join(undated), file=sys.stderr)
    if not runs:
        parser.error('no report%s in %s; %s' % (' of the task %s' % wish.task if wish.task else '', wish.folder,
                                                'tasks there: %s' % ', '.join(tasks) if tasks else 'reports are made by ~report and the program report'))
    trainees = sorted({run.trainee for run in runs})
    wish.experts = [unicodedata.normalize('NFC', name) for name in wish.experts]
    for name in wish.experts:
        if name not in trainees:
            parser.error("--experts: there is no run of '%s'; trainees: %s" % (name, ', '.join(trainees)))
    rows = curves.table(runs)
    print('%-16s %-16s %5s %7s %10s %11s %6s %7s' % ('task', 'trainee', 'runs', 'passed', 'first pass', 'first score', 'best', 'lately'))
    for row in rows:
        print('%-16s %-16s %5d %7d %10s %11.1f %6.1f %7.1f' % (
            row['task'], row['trainee'], row['runs'], row['passed'], row['first_pass'] or '-', row['first_score'], row['best'],
            row['lately']))
    try:
        if wish.experts:
            print('\n' + curves.marks_yaml(curves.marks([run for run in runs if run.trainee in wish.experts])))
        with open(wish.out, 'w', encoding='utf-8') as file:
            file.write(curves.page(runs, wish.experts))
        if wish.csv:
            with open(wish.csv, 'w', encoding='utf-8', newline='') as file:
                writer = csv.DictWriter(file, list(rows[0]))
                writer.writeheader()
                writer.writerows(rows)
    except (OSError, ValueError) as fault:
        parser.error(str(fault))
    print('curves: %s' % os.path.abspath(wish.out))


if __name__ == '__main__':
    main()
