#!/usr/bin/env python3
"""Counts what a run of ctest did: the cases in the JUnit files that its tests wrote, and the entries that write none.

test_summary.py --build FOLDER --log FILE --out FILE [--times FILE] [-- CTEST_ARGUMENTS]

The log is ctest's output. Every test that ctest lists under the same arguments counts: one that did not run has failed, and
so has a program none of whose shares had a case. Prints what failed, writes "passed failed skipped" to --out, and adds a
line "seconds name" for each case to --times.
"""
import argparse
import collections
import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree

Counts = collections.namedtuple('Counts', 'passed failed skipped')
# One test of ctest: its name, its result ('Passed', 'Failed', 'Timeout', ...) or None, and its JUnit file or None.
Entry = collections.namedtuple('Entry', 'name result junit')
# One case of a JUnit file; text is the failure's.
Case = collections.namedtuple('Case', 'name outcome text seconds', defaults=(0.0,))

RESULT_LINE = re.compile(r'^\s*\d+/\d+ Test\s+#\d+: (\S+) \.*\s*(?:\*\*\*)?([A-Z][A-Za-z ]*?)(?::.*|\s+[\d.]+ sec.*)?$')
SHOWN_LINES = 12


def parseResults(log_text):
    """ctest's results by test name."""
    results = {}
    for line in log_text.splitlines():
        match = RESULT_LINE.match(line)
        if match:
            results[match.group(1)] = match.group(2).strip()
    return results


def listEntries(tests, results):
    """tests: the list in ctest's --show-only=json-v1. catkin's command names the JUnit file after run_tests.py, others
    as gtest's option."""
    entries = []
    for test in tests:
        command = test.get('command', [])
        junit = next((word.split(':', 1)[1] for word in command if word.startswith('--gtest_output=xml:')), None)
        for before, argument in zip(command, command[1:]):
            if os.path.basename(before) == 'run_tests.py' and argument.endswith('.xml'):
                junit = argument
        entries.append(Entry(test['name'], results.get(test['name']), junit))
    return entries


def readCases(path):
    """The cases of a JUnit file; None where it is missing or broken."""
    try:
        root = xml.etree.ElementTree.parse(path).getroot()
    except (OSError, xml.etree.ElementTree.ParseError):
        return None
    cases = []
    for case in root.iter('testcase'):
        name = '.'.join(part for part in (case.get('classname'), case.get('name')) if part)
        wrong = case.find('failure')
        if wrong is None:
            wrong = case.find('error')
        seconds = float(case.get('time') or 0.0)
        if wrong is not None:
            cases.append(Case(name, 'failed', wrong.text or wrong.get('message') or '', seconds))
        elif case.find('skipped') is not None or case.get('result') == 'skipped' or case.get('status') == 'notrun':
            cases.append(Case(name, 'skipped', '', seconds))
        else:
            cases.append(Case(name, 'passed', '', seconds))
    return cases


def allCases(entry):
    """The cases of one entry. rostest writes a file with one case for each <test>, which says no more than that it ran,
    and beside it a file rosunit-NAME.xml with the cases themselves: these stand in for the former."""
    cases = readCases(entry.junit)
    if cases is None or not os.path.basename(entry.junit).startswith('rostest-'):
        return cases
    detailed = []
    for case in cases:
        name = re.sub(r'^test', '', case.name.split('.')[-1])
        inner = readCases(os.path.join(os.path.dirname(entry.junit), 'rosunit-%s.xml' % name))
        if inner:
            detailed += inner
            if case.outcome == 'failed' and all(c.outcome != 'failed' for c in inner):
                detailed.append(case)
        elif inner is not None and case.outcome == 'passed':
            detailed.append(case._replace(outcome='failed', text='it ran no test'))
        else:
            detailed.append(case)
    return detailed


def summarize(entries):
    """The counts, a text for each failure, and the cases."""
    passed = failed = skipped = 0
    failures = []
    all_cases = []
    in_program = collections.Counter()
    for entry in entries:
        went_well = entry.result in ('Passed', 'Skipped')
        cases = allCases(entry) if entry.junit and entry.result not in (None, 'Not Run') else None
        program = re.sub(r'_\d+$', '', entry.name)  # several entries run a share of it each
        if cases is not None:
            in_program[program] += len(cases)
            all_cases += cases
            passed += sum(case.outcome == 'passed' for case in cases)
            skipped += sum(case.outcome == 'skipped' for case in cases)
            wrong = [case for case in cases if case.outcome == 'failed']
            failed += len(wrong)
            failures += ['%s: %s\n%s' % (entry.name, case.name, shorten(case.text)) for case in wrong]
            if went_well or wrong:
                continue
        elif went_well and not entry.junit:
            passed += entry.result == 'Passed'
            skipped += entry.result == 'Skipped'
            continue
        # Cases alone do not tell of a crash at the end, a time limit or a test that was never started.
        failed += 1
        failures.append('%s: %s' % (entry.name, 'no results' if went_well else entry.result or 'did not run'))
    for program in sorted(name for name, cases in in_program.items() if not cases):
        failed += 1
        failures.append(program + ': without a test')
    if not entries:
        failed += 1
        failures.append('no test was found')
    return Counts(passed, failed, skipped), failures, all_cases


def shorten(text):
    lines = text.strip().splitlines()
    if len(lines) > SHOWN_LINES:
        lines = lines[:SHOWN_LINES] + ['...']
    return '\n'.join('    ' + line for line in lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--build', required=True, help='the folder in which ctest ran')
    parser.add_argument('--log', required=True, help="ctest's output")
    parser.add_argument('--out', required=True, help='where to write "passed failed skipped"')
    parser.add_argument('--times', help='where to add the seconds of each case')
    parser.add_argument('ctest_arguments', nargs='*')
    options = parser.parse_args()

    listed = subprocess.run(['ctest', '--show-only=json-v1'] + options.ctest_arguments, cwd=options.build,
                            stdout=subprocess.PIPE, check=True)
    with open(options.log, encoding='utf-8', errors='replace') as log:
        results = parseResults(log.read())
    entries = listEntries(json.loads(listed.stdout)['tests'], results)
    counts, failures, cases = summarize(entries)
    for failure in failures:
        print('FAILED ' + failure)
    if failures:
        print('The whole log: ' + options.log)
    with open(options.out, 'w', encoding='utf-8') as out:
        print(*counts, file=out)
    if options.times:
        with open(options.times, 'a', encoding='utf-8') as out:
            for case in cases:
                print('%.3f %s' % (case.seconds, case.name.replace(' ', '_')), file=out)


if __name__ == '__main__':
    sys.exit(main())
