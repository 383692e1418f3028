#!/usr/bin/env python3
"""The keys of scenes, materials and tasks on the pages of docs/reference against those that the parsers ask for."""
import re
import unittest

from docs_test import read
from reference_support import Compared, calls, constant, inside, members, named, only, rangeOf, rows, split, valueOf

PARSERS = {name: read('src/io/%s.cpp' % name) + read('src/io/region_yaml.cpp') for name in ('scene', 'material_yaml', 'task')}
LONGEST = only(r'kMaxLength = ([\d.]+)', read('src/io/region_yaml.h'))
# Page, section, prefix of the keys; parser, name of the map in it; struct that has the defaults, its header.
MAPS = (
    ('scenes', 'Scene files', '', 'scene', '"the scene"', '', ''),
    ('scenes', 'World', '', 'scene', '"world"', 'WorldSettings', 'world/world.h'),
    ('scenes', 'World', 'pick.', 'scene', '"pick"', 'WorldSettings', 'world/world.h'),
    ('scenes', 'World', 'push.', 'scene', '"push"', 'WorldSettings', 'world/world.h'),
    ('scenes', 'Attachments', '', 'scene', '"an attachment"', 'AttachCommand', 'tools/command.h'),
    ('scenes', 'Bodies', '', 'scene', '"a body"', 'BodyDef', 'body/body_def.h'),
    ('scenes', 'Obstacles', '', 'scene', '"an obstacle"', 'ObstacleDef', 'world/world.h'),
    ('scenes', 'Clusters', '', 'scene', '"clusters"', 'ClusterOptions', 'dynamics/clusters.h'),
    ('scenes', 'Copies', '', 'scene', '"copies"', '', ''),
    ('scenes', 'Cavities', '', 'scene', '"cavities"', 'CavityFill', 'body/body_def.h'),
    ('materials', 'Keys', '', 'material_yaml', 'what', 'Material', 'dynamics/material.h'),
    ('materials', 'Curves and plasticity', '', 'material_yaml', '"plasticity"', 'Plasticity', 'dynamics/material.h'),
    ('materials', 'Fibres', '', 'material_yaml', '"fibres"', 'Fibres', 'dynamics/material.h'),
    ('materials', 'How tissue looks', '', 'material_yaml', '"outer"', 'Look', 'appearance/look.h'),
    ('materials', 'How tissue looks', '', 'material_yaml', '"inner"', 'Look', 'appearance/look.h'),
    ('tasks', 'Keys', '', 'task', '"the task"', 'TaskDef', 'training/task.h'),
    ('tasks', 'Plan and target', '', 'task', '"plan"', 'CutPlan', 'training/rest_tissue.h'),
    ('tasks', 'Limits', '', 'task', '"limits"', 'TaskLimits', 'training/task.h'),
    ('tasks', 'Stages', '', 'task', '"a stage"', 'Stage', 'training/task.h'),
    ('tasks', 'Metrics that count', '', 'task', '"metric "', 'WeightedMetric', 'training/task.h'),
)
# Whose keys are said in words: page, what follows the place and precedes its end; parser, name of the map.
IN_WORDS = (
    ('scenes', '| `fixed` |', '\n', 'scene', '"fixed"'), ('scenes', '| `regions` |', '\n', 'scene', '"regions"'),
    ('scenes', '| `primitive` |', '\n', 'scene', '"primitive"'), ('scenes', '| `pose` |', '\n', 'scene', '"pose"'),
    ('scenes', '| `region` |', '\n', 'scene', '"region"'), ('scenes', '| `fixed` |', '\n', 'scene', '"box"'),
    ('scenes', '| `fixed` |', '\n', 'scene', '"plane"'), ('scenes', '| `fixed` |', '\n', 'scene', '"sphere"'),
    ('materials', '`outer` is', 'faces of cuts', 'material_yaml', '"appearance"'), ('tasks', '`target` has', '\n', 'task', '"target"'),
    ('tasks', '| `forbidden` |', '\n', 'task', '"an entry of forbidden"'),
)


def rangeIn(expression, body):
    """As rangeOf(), of a NumberRange."""
    if expression.startswith('lengths('):
        given = split(inside(expression, 7))
        return (float(given[0] or '-' + LONGEST) if given[0] else -float(LONGEST)), float(LONGEST), given[-1] == 'true', 'm'
    if not expression.startswith('{'):
        expression = '{%s}' % only(r'NumberRange %s\{(.*?)\}' % expression, body)
    low, high, *more = split(expression[1:-1])
    unit = more[1].strip('"').replace('^2', '²').replace('^3', '³') if more[1:] and more[1][0] == '"' else ''
    return constant(low, 'kMaxLength = %s;' % LONGEST), constant(high, 'kMaxLength = %s;' % LONGEST), more[:1] == ['true'], unit


def literals(expression, body, bound):
    """The keys that an argument may be."""
    if expression[0] == '"':
        return [expression.strip('"')]
    name = re.match(r'\w+', expression).group()
    if name in bound:
        return [bound[name]]
    for pattern in (r'\b%s\{([^}]*)\}', r'\b%s = ([^;]*);', r'\b%s : \{([^}]*)\}'):
        for words in re.findall(pattern % name, body):
            if re.search(r'"\w+"', words):
                return re.findall(r'"(\w+)"', words)
    return literals(only(r'\b%s (?::|=) (\w+)[)\[]' % name, body), body, bound)


def keysOf(text, body, variable, bound=()):
    """name -> (range or None, member that it goes to or None) of what is asked of a map in this body and in the functions
    that it is given to."""
    known, bound = {}, dict(bound)

    def add(name, limits=None, target=None):
        before = known.get(name, (None, None))
        known[name] = (limits or before[0], target or before[1])

    for match, given in calls(r'\b%s\.(number|whole|text|vector|numbers|choice|get|has)' % variable, body):
        kind = match.group(1)
        if any(value == 'false' and body[:match.start()].endswith(own + ' ? ') for own, value in bound.items()):
            continue
        limits = {'number': given[1:2], 'vector': given[1:2], 'numbers': given[2:3]}.get(kind)
        for name in literals(given[0], body, bound):
            if kind == 'whole':
                add(name, (constant(given[1], text), constant(given[2], text), False, ''), given[3])
            else:
                add(name, rangeIn(limits[0], body) if limits else None, given[-1] if limits else None)
    for match, given in calls(r'\b(read\w+)', body):
        name = match.group(1)
        if name in ('readNumber', 'readWhole') and re.match(r'key\b|"\w+[\["]', given[2]):  # parts of a value
            key = bound.get('key') if given[2].startswith('key') else re.match(r'"(\w+)', given[2]).group(1)
            if key in known and not known[key][0]:
                ends = (constant(given[3], text), constant(given[4], text), False, '') if name == 'readWhole' else rangeIn(given[3], body)
                add(key, ends)
        elif variable in given:
            taken = re.search(r'\b%s\(([^;{]*?YamlMap& (\w+)[^;{]*?)\)(?: const)? \{' % name, text)
            names = [part.split()[-1] for part in split(taken.group(1))]
            passed = {own: value.strip('"') for own, value in zip(names, given) if re.match('"|true$|false$', value)}
            for key, facts in keysOf(text, inside(text, taken.end() - 1, '{}'), taken.group(2), passed).items():
                add(key, facts[0], given[names.index(key)] if key in names else facts[1])
    return known


def mapKeys(parser, what):
    text = PARSERS[parser]
    begin = re.search(r'YamlMap (\w+)\((?:[^;]*, )?%s' % re.escape(what), text)
    body = text[begin.end():]
    end = re.search(r'\b%s\.finish\(\)' % begin.group(1), body) or re.search(r'\n}\n', body)
    start = max(text.rfind('\n}\n', 0, begin.start()), text.rfind('\n  }\n', 0, begin.start()))
    return keysOf(text, text[start:begin.start()].replace(begin.group(1) + '.', '_.') + body[:end.start()], begin.group(1))


class Keys(Compared):
    """Of one page."""
    numbers = 0  # so many ranges and defaults are compared

    def code(self):
        known = {}
        maps = [entry[1:] for entry in MAPS if entry[0] == self.page]
        for section, prefix, parser, what, struct, header in maps:
            begins = members(struct, read('include/meshless_surgery/' + header)) if struct else {}
            at = PARSERS[parser].index(what)
            for name, (limits, target) in mapKeys(parser, what).items():
                target = (target or name).split('.')[-1]
                local = re.findall(r'\b(?:double|int)\b[^;]*?\b%s = ([\d.]+)' % target, PARSERS[parser][at:at + 900])
                known[section, prefix + name] = (limits, float(local[0]) if local else begins.get(target))
        nested = {(section, prefix.strip('.')) for section, prefix, *_ in maps if prefix}
        return {name: facts for name, facts in known.items() if name not in nested}

    def agree(self, code, said):
        """What the parser or the struct does not say as a number or a word is not compared; 0 may be said in words."""
        begins = code[1] in (None, '', said[1]) or said[1] == 'required' or said[1] is None and code[1] == 0.0
        return code[0] in (None, said[0]) and begins

    def said(self, text):
        known = {}
        for section in sorted({entry[1] for entry in MAPS if entry[0] == self.page}):
            heads = {'Plan and target': ['key of `plan`'], 'Stages': ['key', 'condition']}.get(section, ['key'])
            for row in [row for head in heads for row in rows(text, section, head)]:
                for name in named(row[0]):
                    name = re.sub(r'(\w+): \{(\w+)\}$', r'\1.\2', name) if len(row) > 2 else name.split(':')[0]
                    facts = (rangeOf(row[2]), valueOf(row[1])) if len(row) > 2 else (None, None)
                    if row[-1].startswith('as for [bodies]'):
                        facts = known['Bodies', name]
                    known.update({(section, same): facts for same in [name] + re.findall(r'`(\w+)` is the same key', row[-1])})
        return known

    def testMostHaveARangeOrADefaultToCompare(self):
        """Else a parser has a form that is not read here."""
        facts = [fact for facts in self.code().values() for fact in facts]
        self.assertGreaterEqual(sum(fact not in (None, '') for fact in facts), self.numbers)

    def testThePlacesOfKeysThatAreSaidInWordsHaveThem(self):
        for begin, end, parser, what in [entry[1:] for entry in IN_WORDS if entry[0] == self.page]:
            place, keys = only(r'%s(.*?)%s' % (re.escape(begin), end), self.text()), set(mapKeys(parser, what))
            self.assertTrue(keys)
            self.assertEqual(set(), {key for key in keys if not re.search(r'\b%s\b' % key, place)}, begin)


class ScenesTest(Keys, unittest.TestCase):
    page, least, numbers = 'scenes', 60, 60
    planted = (('| `step_rate` | 120 |', '| `step_rate` | 60 |'), ('| 1 to 64 |', '| 1 to 65 |'), ('`ground_friction`', '`ground_fricton`'),
               ('[0, 0, -9.81]', '[0, 0, 9.81]'), ('| `contact` | `surface` |', '| `contact` | `none` |'),
               ('| above 0 to 3600 s |', '| 0 to 3600 s |'))


class MaterialsTest(Keys, unittest.TestCase):
    page, least, numbers = 'materials', 25, 30
    planted = (('| `beta` | 0.2 |', '| `beta` | 0.3 |'), ('| 1e-5 to 1 m |', '| 1e-5 to 1 |'), ('`young` is', '`yong` is'))


class TasksTest(Keys, unittest.TestCase):
    page, least, numbers = 'tasks', 40, 15
    planted = (('| above 0 to 86400 s |', '| 0 to 86400 s |'), ('| `tolerance` | 0.002 m |', '| `tolerance` | 0.02 m |'),
               ('`hand_over: {', '`take_over: {'))

    def testConditionsHaveTheirKeysAndRanges(self):
        parts = re.split(r'kind == "(\w+)"', only(r'void readCondition\((.*?)\n  \}\n', PARSERS['task']))
        branches = dict(zip(parts[1::2], parts[2::2]), leave_nothing=parts[-1][parts[-1].rindex('} else {'):])
        said = {named(row[0])[0].split(':')[0]: row for row in rows(self.text(), 'Stages', 'condition')}
        self.assertGreater(len(branches), 8)
        for kind, branch in branches.items():
            own = branch if kind == 'leave_nothing' else branch.split('} else ')[0]
            for key, (limits, _) in keysOf(PARSERS['task'], own, 'map').items():
                self.assertRegex(' '.join(said[kind]), r'\b%s\b' % key, kind)
                self.assertIn((limits or ())[:3], ((), (rangeOf(said[kind][1]) or ())[:3]), kind + ' ' + key)


if __name__ == '__main__':
    unittest.main()
