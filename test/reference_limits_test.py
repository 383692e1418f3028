#!/usr/bin/env python3
"""Numbers in sentences of docs/reference against the constants of the sources: limits, versions, times."""
import re
import unittest

from docs_test import read
from reference_support import NUMBER, Compared, constant, number, only

# page, its sentence with N for the number, source, constant; how many of it the page's unit is.
LIMITS = (
    ('sessions', 'A state of another version is refused; this one is N:', 'src/world/saved_world_impl.h', 'kStateVersion', 1),
    ('sessions', 'A log of another version is refused with its version; this one is N.', 'src/world/log_records.h', 'kLogVersion', 1),
    ('sessions', 'of another kind, or longer than N MiB', 'include/meshless_surgery/world/saved_world.h', 'kMostStateBytes', 1 << 20),
    ('sessions', 'is 1 to N letters, digits', 'src/io/session_folder.cpp', 'kLongestName', 1),
    ('sessions', '`.before.2` ... `.before.N`', 'src/io/autosave_file.cpp', 'kMostAside', 1),
    ('sessions', '(up to `.N`)', 'src/io/autosave_file.cpp', 'kMostProcesses', 1),
    ('sessions', 'a state for each N s of processor time', 'include/meshless_surgery/world/log_index.h', 'kStateEvery', 1),
    ('sessions', 'green without force and red from N N on', 'src/ros/review_node.cpp', 'kFullForce', 1),
    ('sessions', '`speed` N to 100 times', 'src/ros/review_node.cpp', 'kLeastSpeed', 1),
    ('sessions', '`speed` 0.01 to N times', 'src/ros/review_node.cpp', 'kMostSpeed', 1),
    ('meshes', 'A file has at most N MiB', 'src/io/mesh_format.h', 'kMaxMeshBytes', 1 << 20),
    ('meshes', 'MiB, N points', 'src/io/mesh_format.h', 'kMaxPoints', 1),
    ('meshes', 'points, N faces or cells', 'src/io/mesh_format.h', 'kMaxFaces', 1),
    ('meshes', 'cells and N corners', 'src/io/mesh_format.h', 'kMaxCorners', 1),
    ('meshes', 'Up to N NUL bytes', 'src/io/obj_cells.cpp', 'kMostNuls', 1),
    ('meshes', 'longer than N m or', 'src/body/prepare_body.cpp', 'kLargest', 1),
    ('meshes', 'shorter than N mm', 'src/body/prepare_body.cpp', 'kSmallest', 0.001),
    ('services', 'Up to N cuts and incisions can be undone', 'src/world/world_undo.cpp', 'kMostUndone', 1),
    ('services', 'There can be up to N pieces', 'src/world/world_impl.h', 'kMostPieces', 1),
    ('services', 'Up to N cuts may wait for', 'src/ros/runner.h', 'kMostClosing', 1),
    ('services', 'Up to N cuts close at', 'src/ros/runner.h', 'kMostClosing', 1),
    ('services', 'computes 1 to N steps', 'src/ros/long_work.h', 'kMaxSteps', 1),
    ('services', '`particles[k]` (up to N)', 'src/ros/live_training.cpp', 'kMostPlaces', 1),
    ('services', 'takes up to N goals', 'src/ros/actions.cpp', 'kMostGoals', 1),
    ('services', 'The jaws close at N m/s', 'src/world/world_clip.cpp', 'kJawSpeed', 1),
    ('services', 'have fewer than N % of the', 'src/io/cloud_shape.cpp', 'kLeastPart', 0.01),
    ('services', 'The 4 to N points that are left', 'src/io/cloud_shape.cpp', 'kMostLeft', 1),
    ('services', 'mean distance to N neighbours', 'src/io/cloud_shape.cpp', 'kNeighbours', 1),
    ('services', 'The cloud is then N to 10 m', 'src/io/cloud_shape.cpp', 'kSmallest', 1),
    ('services', 'The cloud is then 0.001 to N m', 'src/io/cloud_shape.cpp', 'kLargest', 1),
    ('services', 'at most N letters, digits', 'src/ros/border_check.h', 'kMaxName', 1),
    ('services', 'must be at least N; it', 'src/ros/border_check.h', 'kMinQuaternionNorm', 1),
    ('services', 'each coordinate -1e6 to N m', 'src/ros/border_check.h', 'kMaxCoordinate', 1),
    ('services', '| `timeout` | 0 to 60 s of wall time | N s', 'src/ros/services.cpp', 'kCloudTimeout', 1),
    ('topics', 'at most N x 512 pixels', 'include/meshless_surgery/appearance/image.h', 'kMostSide', 1),
    ('topics', 'opening [rad], -3.2 to N.', 'src/ros/tool_inputs.cpp', 'kMaxJaw', 1),
    ('topics', 'When it was above N and', 'src/ros/streamed_tools.h', 'kJawOpen', 1),
    ('topics', 'then falls below N,', 'src/ros/streamed_tools.h', 'kJawClosed', 1),
    ('topics', 'The frame is read every N ms', 'src/ros/tool_inputs.cpp', 'kLookEvery', 0.001),
    ('topics', 'not at all while N other callers', 'src/ros/frames.h', 'kMostWaiting', 1),
    ('topics', 'in as much time as was lost, at most N ms', 'src/ros/force_stream.h', 'kMostLate', 0.001),
    ('topics', 'counts as N ms', 'src/ros/tool_motion.h', 'kLongestTick', 0.001),
    ('topics', 'only older stamps have come for N s', 'src/ros/stamp_order.h', 'kLongestLate', 1),
    ('topics', 'faster than that, and than N m/s', 'src/ros/streamed_tools.cpp', 'kHandSpeed', 1),
    ('materials', 'file of up to N MiB', 'src/io/image_file.cpp', 'kMostBytes', 1 << 20),
    ('materials', 'MiB and N pixels', 'src/io/image_file.cpp', 'kMostPixels', 1),
    ('materials', 'After N cells it repeats', 'src/appearance/look.cpp', 'kPeriod', 1),
    ('materials', '(at most N KiB)', 'src/ros/services.cpp', 'kMaxYaml', 1 << 10),
    ('materials', 'shrunk to at most N x 512', 'include/meshless_surgery/appearance/image.h', 'kMostSide', 1),
    ('scenes', 'a YAML file of at most N MiB', 'src/io/yaml_map.cpp', 'kMaxBytes', 1 << 20),
    ('scenes', 'a list of up to N [bodies]', 'src/io/scene.cpp', 'kMaxBodies', 1),
    ('scenes', 'a list of up to N closed surfaces', 'src/io/scene.cpp', 'kMaxObstacles', 1),
    ('scenes', 'a list of up to N: [attachments]', 'src/io/scene.cpp', 'kMaxAttachments', 1),
    ('scenes', 'to 1000 m, at most N particles', 'src/body/prepare_body.cpp', 'kMaxParticles', 1),
    ('scenes', 'above 0 to 1000 m, at most N triangles | edge', 'src/io/primitive_mesh.cpp', 'kMaxTriangles', 1),
    ('scenes', 'above 0 to 1000 m, at most N triangles | what', 'src/body/prepare_body.cpp', 'kMostCollisionTriangles', 1),
    ('scenes', 'edges of N spacings', 'src/body/prepare_body.cpp', 'kCollisionEdge', 1),
    ('scenes', 'comes in within N s', 'src/body/cavities.cpp', 'kFillTime', 1),
    ('tasks', '| none | up to N MiB |', 'src/io/task.cpp', 'kMostPicture', 1 << 20),
    ('tasks', '| required | 1 to N | one after', 'src/io/task.cpp', 'kMostStages', 1),
    ('tasks', '| up to N | each has a `name`', 'src/io/task.cpp', 'kMostForbidden', 1),
    ('parameters', 'at least N if not 0', 'src/ros/settings.cpp', 'kShortestAutosave', 1),
    ('parameters', '| empty | up to N characters', 'src/ros/live_training.cpp', 'kMostTrainee', 1),
    ('rviz', 'more than N s after the message before', 'src/rviz/between_states.cpp', 'kLongestInterval', 1),
    ('rviz', '*Width* (N mm at first)', 'src/rviz/clip_tool.cpp', 'kClipWidth', 0.001),
    ('rviz', '*Opening* (N cm)', 'src/rviz/clip_tool.cpp', 'kClipOpening', 0.01),
    ('services', '| `~clip` | `width` | 0 to 1000 m; up to ten times `opening` | N m', 'src/rviz/clip_tool.cpp', 'kClipWidth', 1),
    ('services', '| `~clip` | `opening` | 0 to 1000 m | N m', 'src/rviz/clip_tool.cpp', 'kClipOpening', 1),
    ('programs', 'for N over its `damping`', 'test/drive/drive.cpp', 'kDecays', 1),
    ('programs', 'over its `damping`, at most N s', 'test/drive/drive.cpp', 'kLongestAlone', 1),
)


class LimitsTest(Compared, unittest.TestCase):
    """Numbers in sentences."""
    least = 60
    planted = (('this one is 33', 'this one is 21'), ('8,000,000 faces', '9,000,000 faces'), ('289 cells', '290 cells'))

    def text(self):
        return '\n'.join('PAGE %s\n%s' % (page, read('docs/reference/%s.md' % page)) for page in sorted({row[0] for row in LIMITS}))

    def code(self):
        return {row[:2]: constant(row[3], read(row[2])) for row in LIMITS}

    def agree(self, code, said):
        return abs(code - said) < 1e-9 * abs(code)

    def said(self, text):
        known = {}
        for page, sentence, _, _, unit in LIMITS:
            words = re.escape(sentence).replace('N', '(%s)' % NUMBER, 1)
            part = only(r'PAGE %s\n(.*?)(?:PAGE |\Z)' % page, text)
            known[page, sentence] = number(only(re.sub(r'(?:\\ )', r'\\s+', words), part)) * unit
        return known

    def test_a_clip_is_drawn_before_it_is_put_on_as_the_command_makes_it(self):
        for name, drawn in (('width', 'kClipWidth'), ('opening', 'kClipOpening')):
            made = only(r'struct ClipCommand \{[^}]*?double %s = ([\d.]+);' % name, re.sub(r'//.*', '', re.sub(r'\{\}', '', read('include/meshless_surgery/tools/command.h'))))
            self.assertEqual(float(made), constant(drawn, read('src/rviz/clip_tool.cpp')), name)


if __name__ == '__main__':
    unittest.main()
