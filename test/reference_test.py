#!/usr/bin/env python3
"""The pages of docs/reference against the sources that they speak of: names, types, signatures, messages. The keys of files are in
reference_keys_test.py, the numbers of sentences in reference_limits_test.py."""
import ast
import os
import re
import unittest
import xml.etree.ElementTree

from docs_test import CHECKOUT, read
from reference_support import NUMBER, Compared, calls, constant, files, found, members, named, number, only, rangeOf, rows, stems, valueOf


def services(path):
    """~name -> type of what a source offers."""
    code = read(path)
    types = dict(found(r'\bbool (\w+)\((\w+::\w+)::Request&', code))
    offered = found(r'\badvertise\w*\((?:\w+, )*"(\w+)", &\w+::(\w+)', code)
    return {'~' + name: types[handler].replace('meshless_surgery::', '').replace('::', '/') for name, handler in offered}


class ServicesTest(Compared, unittest.TestCase):
    page, least, planted = 'services', 30, (('| `~probe` |', '| `~prod` |'), ('| `Lock` |', '| `Clip` |'))

    def code(self):
        nodes = [path for path in files('src/ros/*.cpp') if 'advertiseService' in read(path) and 'review' not in path]
        return {name: kind for path in nodes for name, kind in services(path).items()}

    def said(self, text):
        return {name: kind for row in rows(text, 'Services', 'name')
                for name, kind in zip(named(row[0]), named(row[1]) * len(named(row[0])))}


class ActionsTest(Compared, unittest.TestCase):
    page, least, planted = 'services', 4, (('`CutAction`', '`StepAction`'), ('`waiting`, `stepping`', '`waiting`'))

    def code(self):
        offered = set(found(r'\b\w+\(handle, "(\w+)"', read('src/ros/actions.cpp')))
        self.assertEqual(offered, {name.lower() for name in stems('action/*.action')})
        phases = {name: found(r'(?m)^string [A-Z]+=(\w+)', read('action/%s.action' % name.capitalize())) for name in offered}
        return {'~actions/' + name: (name.capitalize() + 'Action', phases[name]) for name in offered}

    def said(self, text):
        return {named(row[0])[0]: (named(row[1])[0], named(row[3].split(';')[0])) for row in rows(text, 'Actions', 'name')}


class RangesTest(Compared, unittest.TestCase):
    """Numbers of requests."""
    page, least = 'services', 20
    planted = (('| 0 to 60 s of simulated', '| 0 to 600 s of simulated'), ('`~clip` | `width`', '`~clip` | `wide`'))

    def code(self):
        sources = [read('src/ros/' + name) for name in ('services.cpp', 'long_work.h')]
        numbers, known = read('src/ros/border_check.h') + ''.join(sources), {}
        for code in sources:
            parts = re.split(r'\n  (?:bool|Result<std::optional<Region>>) (\w+)\(', code)
            bodies = dict(zip(parts[1::2], parts[2::2]))
            for name, body in bodies.items():
                if name == 'regionOf':
                    continue
                checks = calls(r'check\.number', body + (bodies['regionOf'] if 'regionOf(' in body else ''))
                for _, (field, _, low, high, unit) in checks:
                    service = '~' + re.sub('([A-Z])', r'_\1', name).lower()
                    ends = constant(low, numbers), constant(high, numbers)
                    known[service, field.strip('"')] = (*ends, False, unit.strip('"').replace('^3', '³'))
        return known

    def said(self, text):
        return {(service, field): rangeOf(row[2]) for row in rows(text, 'Ranges', 'service')
                for service in named(row[0]) for field in named(row[1])}


def typeOf(cpp):
    header = read('src/ros/crtk_messages.h')
    crtk = dict(found(r'DataType<meshless::(\w+)> \{\s+static const char\* value\(\) \{ return "([\w/]+)"', header))
    return crtk.get(cpp) or cpp.replace('meshless_surgery::', '').replace('::', '/')


def topics(path):
    """~name -> (type, whether it is latched) of what a source publishes."""
    code, known = read(path), {}
    tools = only(r'const char\*(?: const)? (?:kTools|names)\[\] = \{(.*?)\}', read('src/ros/publishers.cpp'))
    for match, arguments in calls(r'\badvertise<([\w:]+)>', code):
        name = only(r'"([\w/]+)"', arguments[0] if '"' in arguments[0] else only(r'%s(?:\[\])? = ("[^"]*")' % arguments[0], code))
        before = ['~' + tool for tool in found(r'\w+', tools)] if '+' in arguments[0] else [''] if name.startswith('/') else ['~']
        known.update({start + name: (typeOf(match.group(1)), arguments[-1] == 'true') for start in before})
    return known


class TopicsTest(Compared, unittest.TestCase):
    page, least = 'topics', 30
    planted = (('| `~points` |', '| `~dots` |'), ('| `Info` | latched; ', '| `Info` | '), ('| `Event` |', '| `Info` |'))

    def code(self):
        paths = [path for path in files('src/ros/*.cpp') if 'advertise<' in read(path) and 'review' not in path and 'named_' not in path]
        known = {name: facts for path in paths for name, facts in topics(path).items()}
        known['/diagnostics'] = ('diagnostic_msgs/DiagnosticArray', False)  # diagnostic_updater's
        return known

    def said(self, text):
        return {name: (named(row[1])[0], row[2].startswith('latched'))
                for row in rows(text, 'Published topics', 'name') for name in named(row[0])}


class InstrumentTopicsTest(Compared, unittest.TestCase):
    page, least, planted = 'topics', 9, (('`~NAME/jaw/servo_jp` |', '`~NAME/jaw/servo_js` |'), ('| `geometry_msgs/TwistStamped` |', '| `geometry_msgs/Twist` |'))

    def code(self):
        said = re.findall(r'(?:advertise|subscribe)<([\w:]+)>\(\s*name \+ "(/[\w/]+)"', read('src/ros/named_instruments.cpp'))
        return {'~NAME' + name: typeOf(kind) for kind, name in said}

    def said(self, text):
        return {name: named(row[1])[0] for row in rows(text, 'Instruments', 'name') for name in named(row[0])}


class ReviewTest(Compared, unittest.TestCase):
    page, least, planted = 'sessions', 6, (('| `Review`, latched |', '| `Review` |'), ('service `Seek`', 'service `Play`'))

    def code(self):
        offered = {name: (kind, 'service') for name, kind in services('src/ros/review_node.cpp').items()}
        said = topics('src/ros/review_node.cpp').items()
        return {**offered, **{name: (kind, 'latched' if stays else '') for name, (kind, stays) in said}}

    def said(self, text):
        return {named(row[0])[0]: (named(row[1])[0], re.sub(r'`[^`]*`|[, ]', '', row[1])) for row in rows(text, 'Review', 'name')}


class StreamsTest(Compared, unittest.TestCase):
    page, least, planted = 'topics', 8, (('`~push/servo_cp` | `geometry_msgs/PoseStamped`', '`~push/servo_cp` | `geometry_msgs/Pose`'),)

    def code(self):
        code, known = read('src/ros/tool_inputs.cpp'), {}
        ends = dict(found(r'const std::string (\w+) = input\.name \+ "([\w/]+)"', code))
        for match, arguments in calls(r'\bsubscribe<([\w:]+)>', code):
            names = found(r'Input\{"(\w+)"', code) if arguments[0] in ends else found(r'"([\w/]+)"', only(r'kJaws\[\] = \{(.*?)\}', code))
            known.update({'~' + name + ends.get(arguments[0], ''): typeOf(match.group(1)) for name in names})
        return known

    def said(self, text):
        return {name: named(row[1])[0] for row in rows(text, 'Subscribed topics', 'name') for name in named(row[0])}


class WordsTest(Compared, unittest.TestCase):
    """Lists of words: events, states of tools, what ships, parts of rviz, laws, exceptions, variables of the environment."""
    planted = (('`torn`', '`worn`'), ('| `PAUSED` |', '| `IDLE` |'), ('`dissect`', '`bisect`'), ('`pile`', '`heap`'), ('`fat`', '`fatt`'),
               ('surgery/Review`', 'surgery/View`'), ('| `folds` |', '| `creases` |'), ('| `Cancelled` |', '| `Called` |'),
               ('`home`', '`go`'), ('hand_over, dissect', 'hand_over'))

    def text(self):
        return '\n'.join(read(path) for path in files('docs/reference/*.md') + ['README.md'])

    def code(self):
        streamed, materials = read('src/ros/streamed_tools.cpp'), ''.join(read(path) for path in files('config/materials/*.yaml'))
        plugin = xml.etree.ElementTree.fromstring(read('rviz_plugin.xml'))
        variables = [name for name in ('MESHLESS_SURGERY_OUTPUT', 'ROS_HOME', 'ROS_MASTER_URI', 'ROS_IP', 'ROS_HOSTNAME')
                     if name in read('scripts/lib/environment.bash') + read('src/ros/session.cpp')]
        return {'events': set(found(r'(?m)^string [A-Z_]+=(.*)$', read('msg/Event.msg'))),
                'states': set(found(r'return "([A-Z]+)";', streamed)) | {only(r'fault \? "([A-Z]+)"', read('src/ros/publishers.cpp'))},
                'state_command': set(found(r'word [!=]= "(\w+)"', streamed)),
                'tasks': stems('config/tasks/*.yaml'), 'scenes': stems('config/scenes/*.yaml'),
                'tasks of README': stems('config/tasks/*.yaml'), 'scenes of README': stems('config/scenes/*.yaml'),
                'materials': set(found(r'(?m)^(\w+):', materials)) | {'default'},
                'plays': {name[5:] for name in stems('scripts/play_*.py')},
                'rviz': {entry.get('name').split('/')[1] for entry in plugin.iter('class')},
                'laws': set(found(r'"(\w+)"', only(r'kLawNames\{(.*?)\}', read('test/drive/finding.h')))),
                'exceptions': set(found(r'(?m)^class (\w+)\(', read('python/meshless_surgery/errors.py'))),
                'variables': set(variables)}

    def said(self, text):
        def words(pattern):
            return set(named(only(pattern, text)))
        events = next(row for row in rows(text, 'Published topics', 'name') if row[0] == '`~events`')[2]
        commands = next(row for row in rows(text, 'Subscribed topics', 'name') if 'state_command' in row[0])[2]
        return {'events': set(named(events.split(':')[0])), 'states': {named(row[0])[0] for row in rows(text, 'CRTK', '`operating_state`')},
                'state_command': set(named(commands)),
                'tasks': words(r'`config/tasks` has(.*?)\.'), 'scenes': words(r'`config/scenes` has(.*?)\.'),
                'tasks of README': set(re.findall(r'\w+', only(r'Tasks that ship:(.*?)\(', text))),
                'scenes of README': {name for row in rows(text, 'Scenes', 'scene') for name in named(row[0])},
                'materials': words(r'\*Appearance materials\* are(.*?)Their files') - {'mode', 'alpha', 'beta'},
                'plays': words(r'\| plays (.*?) on the running scene') - {'liver_looks'},
                'rviz': set(found(r'(?m)^\| `meshless_surgery/(\w+)` \|', text)),
                'laws': {name for row in rows(text, 'Drive', 'law') for name in named(row[0])},
                'exceptions': {named(row[0])[0] for row in rows(text, 'Exceptions', 'exception')},
                'variables': {name for row in rows(text, 'Environment variables', 'name') for name in named(row[0])}}


class ParametersTest(Compared, unittest.TestCase):
    page, least = 'parameters', 30
    planted = (('| `state_rate` |', '| `state_rat` |'), ('| `force_rate` | 500 Hz |', '| `force_rate` | 50 Hz |'),
               ('| 1 to 2000 |', '| 1 to 200 |'),
               ('| `paused` | `false` |', '| `paused` | `true` |'), ('| `log` | required |', '| `logs` | required |'))

    def code(self):
        header = read('src/ros/settings.h')
        code = read('src/ros/settings.cpp') + read('src/ros/border_check.h')
        known, begins = {}, members('NodeSettings', header)
        # What both nodes have, what the review node has, and the other one.
        _, shared, review, own = re.split(r'\n(?=\S.* (?:readShared|readReviewSettings|readNodeSettings)\()', code)
        for _, (name, member, *numbers) in calls(r'reader\.(?:read|frame)', shared + own):
            begin = begins[member.split('.')[1]] if member.count('.') == 1 else ''
            if re.search(r'std::optional<double> %s;' % member.split('.')[1], header):
                begin = None  # the scene's
            known[name.strip('"')] = (numbers and (constant(numbers[0], code), constant(numbers[1], code), False) or None, begin)
        return {**known, **{'review ' + name: (None, None) for name in found(r'reader\.(?:read|frame)\("(\w+)"', shared + review)}}

    def said(self, text):
        known = {name: (rangeOf(row[2]) and rangeOf(row[2])[:3], valueOf(row[1]))
                 for row in rows(text, 'Parameters', 'name') for name in named(row[0])}
        review = {'review ' + name: (None, None) for row in rows(text, 'Parameters of the review node', 'name') for name in named(row[0])}
        return {**known, **review}


class LaunchTest(Compared, unittest.TestCase):
    planted = (('| `respawn` | `false` |', '| `respawn` | `true` |'), ('| `env_loader` |', '| `env_load` |'),
               ('| `split` | 2000 |', '| `split` | 20 |'))
    least = 30

    def text(self):
        return read('docs/reference/parameters.md') + read('docs/stations.md') + read('docs/devices.md')

    def code(self):
        known = {}
        for path in files('launch/*.launch'):
            for entry in xml.etree.ElementTree.parse(os.path.join(CHECKOUT, path)).getroot().findall('arg'):
                if entry.get('value') is None:
                    known[os.path.basename(path), entry.get('name')] = entry.get('default')
        return known

    def agree(self, code, said):
        """A default that is computed is said in words."""
        return code == said or '$(' in (code or '')

    def said(self, text):
        known = {}
        for section, file in (('Launch arguments', 'training.launch'), ('Launch arguments', 'review.launch'),
                              ('Several stations, several machines', 'lab.launch'), ('Recording', 'record.launch'), ('Arguments', 'device.launch')):
            for row in rows(text, section, 'argument of `%s`' % file):
                names, words = named(row[0]), [word for word in re.split(r', ', row[1])]
                for name, word in zip(names, words if len(words) == len(names) else words * len(names)):
                    known[file, name] = None if word == 'required' else re.sub('^(none|empty).*', '', word.strip('`'))
        return known


class DeviceTest(Compared, unittest.TestCase):
    """Parameters of scripts/device.py that are no arguments of its launch file, and numbers of those that are."""
    planted = (('| `jaw_open` | 0.8 |', '| `jaw_open` | 0.7 |'), ('1 to 1000 Hz', '1 to 100 Hz'), ('| `joy_close` |', '| `joy_shut` |'),
               ('| 0.01 to 100 |', '| 0.1 to 100 |'))
    least = 12

    def text(self):
        return read('docs/devices.md')

    def code(self):
        settings = next(node.value for node in ast.parse(read('scripts/device.py')).body
                        if isinstance(node, ast.Assign) and getattr(node.targets[0], 'id', '') == 'SETTINGS')
        arguments, known = set(re.findall(r'<arg name="(\w+)"', read('launch/device.launch'))), {}
        for key, reader in zip(settings.keys, settings.values):
            name, default, *rest = (ast.literal_eval(argument) for argument in reader.args)
            self.assertEqual(key.value, name)
            is_number = reader.func.id == 'number'
            ends = (*map(float, rest[:2]), False, ''.join(rest[2:])) if is_number else None
            if name not in arguments | {'node', 'rviz_config'} or is_number:
                known[name] = (None if name in arguments else float(default) if is_number else default, ends)
        return known

    def said(self, text):
        own = {named(row[0])[0]: (valueOf(row[1]) if rangeOf(row[2]) else row[1].strip('`'), rangeOf(row[2]))
               for row in rows(text, 'Arguments', 'parameter of `device.py`') if named(row[0])[0] not in ('node', 'rviz_config')}
        launched = {named(row[0])[0]: (None, rangeOf(row[2])) for row in rows(text, 'Arguments', 'argument of `device.launch`')
                    if rangeOf(row[2])}
        return {**own, **launched}


def signature(function):
    """As the page writes it."""
    return '%s(%s)' % (function.name, re.sub(r'^self(, )?|, /', '', ast.unparse(function.args)))


class PythonTest(Compared, unittest.TestCase):
    """Methods of Surgeon and what it hands out, arguments of Environment."""
    page, least = 'python', 60
    planted = (('`probe(point, direction, frame=None)`', '`probe(point, frame=None)`'), ('jaw(angle)', 'jar(angle)'),
               ('| `horizon` | 1000 |', '| `horizon` | 100 |'),
               ("timeout=30.0, frame=''", "timeout=3.0, frame=''"), ('`undo()`', '`redo()`'))

    def methods(self, file, name):
        tree = ast.parse(read('python/meshless_surgery/%s.py' % file))
        body = next(node for node in tree.body if isinstance(node, ast.ClassDef) and node.name == name).body
        return {node.name: node for node in body if isinstance(node, ast.FunctionDef)}

    def code(self):
        known = {}
        for name, function in self.methods('surgeon', 'Surgeon').items():
            written = signature(function).replace('__init__', 'Surgeon')
            if name.endswith('_async'):
                written = name + '(...)'
            elif [ast.unparse(decorator) for decorator in function.decorator_list] == ['property']:
                written = name
            if name == '__init__' or not name.startswith('_'):
                known['Surgeon.' + name] = written
        for file, owner in (('streams', 'ToolStream'), ('goals', 'Goal')):
            known.update({owner + '.' + name: name for name, function in self.methods(file, owner).items()
                          if name[0] != '_' and not function.decorator_list})
        begin = self.methods('environment', 'Environment')['__init__'].args
        values = [None] * (len(begin.args) - 1 - len(begin.defaults)) + [ast.literal_eval(value) for value in begin.defaults]
        known.update({'Environment.' + argument.arg: value for argument, value in zip(begin.args[1:], values)})
        return known

    def agree(self, code, said):
        """Defaults of Environment: those that are numbers."""
        return code == said or said == 'words' and not isinstance(code, (int, float))

    def said(self, text):
        head = only(r'\| method of `(Surgeon\(.*?\))`', text)
        table = rows(text, 'Surgeon', 'method of `%s`' % head)
        known = {'Surgeon.' + re.match(r'\w+', name).group(): name for row in table for name in named(row[0])}
        known['Surgeon.__init__'] = head
        stream = next(row[1] for row in table if 'ToolStream' in row[1])
        goal = only(r'return a `Goal`\.(.*?)```', text)
        known.update({'ToolStream.' + name: name for name in re.findall(r'`(\w+)\(', stream)})
        known.update({'Goal.' + name: name for name in re.findall(r'`(\w+)\(', goal)})
        for row in rows(text, 'Environment', 'argument'):
            known['Environment.' + named(row[0])[0]] = number(row[1].split()[0]) if re.match(NUMBER, row[1]) else 'words'
        return known


class EnvironmentTasksTest(Compared, unittest.TestCase):
    """Tasks that ship, with their scenes and bodies."""
    page, least, planted = 'python', 7, (('| `lump` | pad |', '| `liver` | pad |'), ('gallbladder, duct', 'duct'))

    def code(self):
        known = {}
        for name in stems('config/tasks/*.yaml'):
            scene = only(r'(?m)^scene: (\w+)$', read('config/tasks/%s.yaml' % name))
            known[name] = (scene, found(r'(?m)^  - name: (\w+)', read('config/scenes/%s.yaml' % scene)))
        return known

    def said(self, text):
        return {named(row[0])[0]: (named(row[1])[0], re.split(', ', row[2])) for row in rows(text, 'Environment', 'task')}


SCRIPTS = {'scripts/' + name: 'scripts/' + name for name in ('train', 'check', 'soak', 'fuzz', 'film', 'package_debian')}
PROGRAMS = {**{name: 'src/tools_main/%s.cpp' % name for name in stems('src/tools_main/*.cpp')}, **SCRIPTS,
            'drive': 'test/drive/drive_main.cpp', 'make_meshes': 'test/shapes/make_meshes_main.cpp',
            **{name + '.py': 'scripts/%s.py' % name for name in stems('scripts/*.py') if not name.startswith(('play_', 'surgery_', 'device'))},
            'play_SCENE.py': 'scripts/surgery_client.py'}


class OptionsTest(Compared, unittest.TestCase):
    page, least = 'programs', 10
    planted = (('[--slow]', '[--fast]'), ('[--until S]', ''), ('| `--budget` |', '| `--time` |'), ('[--core]', '[--core] [--shell]'),
               ('rosrun meshless_surgery replay', 'rosrun meshless_surgery repeat'))

    def code(self):
        known = {}
        for name, path in PROGRAMS.items():
            labels = r'(?m)^ {2,4}(?:-\w \| )?(--[a-z-]+)\)'  # of a case, in bash
            pattern = r'add_(?:option|flag|argument)\(\s*[\'"](--[\w-]+)[\'"]' if '.' in os.path.basename(path) else labels
            known[name] = set(re.findall(pattern, read(path))) - {'--help'}
            if 'case' in read(path) or '.' in path:
                self.assertTrue(re.search(pattern, read(path)), path)
        return known

    def said(self, text):
        known = {}
        for row in rows(text, 'Commands', 'command'):
            if re.match(r'`(?:rosrun|scripts)', row[0]):
                words = named(row[0].replace('\\|', '|'))[0].split()
                known[words[words[0] == 'rosrun' and 2]] = set(re.findall(r'(--[a-z-]+)', row[0]))
        options = {name for row in rows(text, 'Drive', 'option of `drive`') for name in named(row[0])}
        self.assertLessEqual(known.get('drive', set()), options)
        return {**known, 'drive': options}


class ExitCodesTest(Compared, unittest.TestCase):
    page, least = 'programs', 9
    planted = (('| `replay` | every recorded hash was met |', '| `replay` | |'), ('it was not | the log or', 'it was not | | the log or'))

    def code(self):
        known = {}
        for name in ('deformer_node', 'review_node', 'replay', 'report', 'drive', 'make_meshes', 'learning_curves.py', 'play_*.py', 'device.py', 'scripts/train',
                     'scripts/check', 'scripts/package_debian'):
            path = PROGRAMS.get(name.replace('*', 'SCENE')) or ('scripts/' + name if name.endswith('.py') else 'src/node_main/%s.cpp' % name)
            code = read(path)
            if name == 'play_*.py' or name == 'learning_curves.py':
                known[name] = {0, 2} | ({1} if 'return 1 if' in code else set())  # 2: argparse's
                self.assertIn('argparse', code)
                continue
            if name == 'device.py':
                taken = found(r'\breturn (\d)\n', code)
            elif path.endswith('.cpp'):
                if 'node_main' in path:
                    code += read('src/node_main/run_node.h') + read('src/node_main/end_on_signal.cpp')
                taken = found(r'(?:\breturn|_exit\(|\?|:) ?(\d)(?= :|;|\);)', code)
            else:
                taken = found(r'\bexit (\d)', re.sub(r'(?m)^ *(?:.*; then )?stop .*|^\(\(.*== 0\)\)$', 'exit 1', code))
            known[name] = {int(n) for n in taken}
        return known

    def said(self, text):
        return {named(row[0])[0]: {n for n, cell in enumerate(row[1:4]) if cell} for row in rows(text, 'Exit codes', 'program')}


class MessagesTest(unittest.TestCase):
    """What the pages print as messages is of literals of the sources, but for names and numbers."""

    def strange(self, messages):
        code = ''.join(read(path) for pattern in ('src/*/*.cpp', 'src/*/*.h', 'include/meshless_surgery/*/*.h') for path in files(pattern))
        code = re.sub(r'"\s+"', '', code)
        literals = {word for word in re.findall(r'"((?:[^"\\\n]|\\.)*)"', code) if ' ' in word and len(word) > 3}

        def alien(message):
            """Two words side by side that no literal has, outside of quotes."""
            known = {at for word in literals for match in re.finditer(re.escape(word), message) for at in range(*match.span())}
            bare = re.sub(r"'[^']*'", lambda match: '#' * len(match.group()), message)
            return any(not known & set(range(match.start(1), match.end(1))) for match in re.finditer(r'(?=(\b[a-z]+ [a-z]+\b))', bare))
        return [message for message in messages if alien(message)]

    def testTheyAreTheSources(self):
        table = [named(row[0])[0] for row in rows(read('docs/reference/services.md'), 'Typical messages', 'message')]
        pages = ''.join(read(path) for path in files('docs/reference/*.md'))
        others = re.findall(r'`([^`]*(?:; accepted|did you mean|is not known)[^`]*)`', pages)
        self.assertGreater(len(table), 10)
        self.assertGreater(len(others), 8)
        self.assertEqual([], self.strange(table + others))

    def testOneThatIsNotIsFound(self):
        wrong = ["no corpse lies there that is called 'spleen'", 'state_rate: between 0.1 and 1000 Hz, please choose']
        self.assertEqual(wrong, self.strange(wrong))


if __name__ == '__main__':
    unittest.main()
