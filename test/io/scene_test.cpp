#include "meshless_surgery/io/scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "io/temporary_folder.h"
#include "meshless_surgery/geometry/query/inside.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "shapes/sampling.h"

namespace meshless {
namespace scene_test {

bool says(const Error& error, const std::string& words) { return error.detail.find(words) != std::string::npos; }

struct Scene : ::testing::Test {
  TemporaryFolder folder;
  FileAccess access;

  void SetUp() override {
    access.folders = {folder.path()};
    ASSERT_TRUE(writeObj(folder.file("cube.obj"), boxMesh(Vec3(1, 1, 1), 2, 2, 2), "").ok());
  }
  Result<SceneDef> read(const std::string& text) { return readScene(folder.write("scenes/s.yaml", text), access); }
  SceneDef good(const std::string& text) {
    Result<SceneDef> scene = read(text);
    EXPECT_TRUE(scene.ok()) << text << "\n" << (scene.ok() ? "" : scene.error().detail);
    return scene.ok() ? *scene : SceneDef{};
  }
  Error bad(const std::string& text) {
    const Result<SceneDef> scene = read(text);
    EXPECT_FALSE(scene.ok()) << text;
    return scene.ok() ? Error{} : scene.error();
  }
};

TEST_F(Scene, EachBodySaysHowFarItsFileIsRepaired) {
  // A cube with a fin.
  std::string fin = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\nv 0.5 -0.5 0\n";
  fin += "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\nf 1 2 9\n";
  folder.write("fin.obj", fin);
  const SceneDef scene = good(
      "obstacles:\n  - {name: tray, file: ../fin.obj}\nbodies:\n  - {file: ../fin.obj}\n"
      "  - {name: wrapped, file: ../fin.obj, repair: wrap}\n  - {name: cube, file: ../cube.obj, repair: none}\n");
  ASSERT_EQ(scene.bodies.size(), 3u);
  EXPECT_EQ(scene.bodies[0].mesh.triangles.size(), 12u);
  EXPECT_NE(scene.bodies[0].notes.back().find("the surface now encloses 1e+06 ml"), std::string::npos)
      << scene.bodies[0].notes.back();
  EXPECT_GT(scene.bodies[1].mesh.triangles.size(), 500u);
  EXPECT_EQ(scene.bodies[2].mesh.triangles.size(), 48u);
  const Error refused = bad("bodies:\n  - {file: ../fin.obj, repair: none}\n");
  EXPECT_NE(refused.detail.find("s.yaml:2: "), std::string::npos) << refused.detail;
  EXPECT_NE(refused.detail.find("'fin.obj': the surface is not manifold"), std::string::npos) << refused.detail;
  EXPECT_NE(bad("bodies:\n  - {primitive: {sphere: 1}, repair: mend}\n").detail.find("with a file"), std::string::npos);
}

TEST_F(Scene, AttachmentsJoinWhatIsThere) {
  const std::string bodies =
      "bodies:\n  - {name: a, file: ../cube.obj}\n  - {name: b, file: ../cube.obj, pose: {position: [0, 0, 1.1]}}\n"
      "obstacles:\n  - {name: tray, primitive: {box: [1, 1, 1]}, pose: {position: [0, 0, -3]}}\nattachments:\n";
  const SceneDef scene = good(
      bodies + "  - {bodies: [a, tray], distance: 0.2, stiffness: 1e6}\n  - {bodies: [b, world], stiffness: 10}\n");
  ASSERT_EQ(scene.attachments.size(), 2u);
  EXPECT_TRUE(scene.attachments[0].name.empty());
  EXPECT_FALSE(scene.attachments[0].strength.has_value());
  const std::map<std::string, std::string> wrong = {
      {"{bodies: [a, c], distance: 1, stiffness: 1}", "'c', did you mean"},
      {"{bodies: [a], distance: 1, stiffness: 1}", "a list of two names"},
      {"{bodies: a, distance: 1, stiffness: 1}", "a list of two names"},
      {"{distance: 1, stiffness: 1}", "a list of two names"},
      {"{bodies: [a, b], stiffness: 1}", "distance"},
      {"{bodies: [a, b], distance: 0, stiffness: 1}", "distance"},
      {"{bodies: [a, b], distance: 1}", "stiffness"},
      {"{bodies: [a, b], distance: 1, stiffness: -1}", "stiffness is -1"},
      {"{bodies: [a, b], distance: 1, stiffness: .inf}", "stiffness"},
      {"{bodies: [a, b], distance: 1, stiffness: 1, strength: .nan}", "strength"},
      {"{bodies: [a, b], distance: 1, stiffness: 1, strength: 0}", "strength"},
      {"{bodies: [a, b], distance: 1, stiffness: 1, region: {}}", "no shape"},
      {"{bodies: [a, b], distance: 1, stiffness: 1, region: 7}", "region"},
      {"{bodies: [a, b], distance: 1, stiffness: 1, name: 'a b'}", "name"},
      {"{bodies: [a, b], distance: 1, stifness: 1}", "stiffness"}};
  for (const auto& [attachment, word] : wrong) {
    const Error refused = bad(bodies + "  - " + attachment + "\n");
    EXPECT_NE(refused.detail.find(word), std::string::npos) << attachment << ": " << refused.detail;
    EXPECT_NE(refused.detail.find("s.yaml:7: "), std::string::npos) << refused.detail;
  }
  bad("bodies: []\nattachments: 3\n");
}

TEST_F(Scene, DefaultsForEverythingButBodies) {
  const SceneDef scene = good("bodies:\n  - file: ../cube.obj\n");
  const WorldSettings defaults;
  EXPECT_EQ(scene.name, "s");
  EXPECT_EQ(scene.world.gravity, defaults.gravity);
  EXPECT_EQ(scene.world.ground, defaults.ground);
  EXPECT_EQ(scene.world.step_rate, defaults.step_rate);
  EXPECT_EQ(scene.world.substeps, defaults.substeps);
  EXPECT_EQ(scene.world.contact, defaults.contact);
  EXPECT_EQ(scene.world.contact, ContactMethod::kSurface);
  EXPECT_TRUE(scene.world.sleep);
  ASSERT_EQ(scene.bodies.size(), 1u);
  const BodyDef& body = scene.bodies[0];
  EXPECT_EQ(body.name, "cube");
  EXPECT_TRUE(body.solid);
  EXPECT_EQ(body.spacing, 0.0);
  EXPECT_EQ(body.clusters.kind, ClusterOptions::Kind::kAuto);
  EXPECT_EQ(body.material.name, "default");
  EXPECT_TRUE(body.fixed.empty());
  EXPECT_NEAR(signedVolume(body.mesh), 1.0, 1e-6);
  EXPECT_TRUE(good("bodies: []\n").bodies.empty());
}

TEST_F(Scene, GroundMayBeNone) {
  for (const char* none : {"none", "~", ""})
    EXPECT_FALSE(good(std::string("world:\n  ground: ") + none + "\nbodies: []\n").world.ground.has_value()) << none;
}

TEST_F(Scene, CopiesFillAGridAndAreTheSameEveryTime) {
  const std::string text =
      "bodies: [{name: b, primitive: {sphere: 0.1}, pose: {position: [1, 0, 0]}, "
      "copies: {count: 7, grid: [2, 2, 2], offset: [1, 2, 3], jitter: 0.1, turn: 0.5, seed: 4}}]\n";
  const SceneDef scene = good(text), again = good(text);
  ASSERT_EQ(scene.bodies.size(), 7u);
  for (int k = 0; k < 7; ++k) {
    const BodyDef& body = scene.bodies[k];
    EXPECT_EQ(body.name, "b_" + std::to_string(k + 1));
    const Vec3 place = Vec3(1, 0, 0) + Vec3(k % 2, 2 * (k / 2 % 2), 3 * (k / 4));
    EXPECT_LE((body.pose.translation - place).cwiseAbs().maxCoeff(), 0.1);
    EXPECT_GT((body.pose.translation - place).norm(), 0.0);
    EXPECT_LE(body.pose.rotation.angularDistance(Quat::Identity()), 0.5 + 1e-12);
    EXPECT_NEAR(body.pose.rotation.norm(), 1.0, 1e-12);
    EXPECT_EQ(body.pose.translation, again.bodies[k].pose.translation);
    EXPECT_EQ(body.pose.rotation.coeffs(), again.bodies[k].pose.rotation.coeffs());
  }
  const SceneDef line = good("bodies: [{primitive: {sphere: 0.1}, copies: {count: 3, offset: [0, 0, 1]}}]\n");
  ASSERT_EQ(line.bodies.size(), 3u);
  EXPECT_EQ(line.bodies[2].pose.translation, Vec3(0, 0, 0)) << "a row along x, and the offset has none";
  EXPECT_EQ(good("bodies: [{primitive: {sphere: 0.1}, copies: {grid: [2, 3, 1], offset: [1, 1, 1]}}]\n").bodies.size(),
            6u);
}

TEST_F(Scene, FaultsAreNamedWithFileLineValueAndRange) {
  struct Case {
    std::string text;
    int line;
    std::vector<std::string> words;
  };
  const std::string body = "bodies:\n  - primitive: {sphere: 0.1}\n";
  const std::vector<Case> cases = {
      {"world:\n  gravty: [0, 0, 0]\nbodies: []\n",
       2,
       {"unknown key 'gravty' in world", "did you mean 'gravity'", "step_rate"}},
      {"wrld: {}\nbodies: []\n", 1, {"'wrld'", "did you mean 'world'"}},
      {body + "    materail: jelly\n", 3, {"'materail'", "did you mean 'material'"}},
      {body + "    fibre_direction: [0, 0, 0]\n", 3, {"fibre_direction is", "of any length but 0"}},
      {body + "    fibre_direction: [0, 1]\n", 3, {"fibre_direction is", "along, or [x, y, z]"}},
      {body + "    fibre_direction: [0, 1, .nan]\n", 3, {"fibre_direction[2] is .nan"}},
      {"materials:\n  a: {youngs_modulus: 1, fibres: 3}\nbodies: []\n", 2, {"fibres is '3'", "or none"}},
      {"materials:\n  a: {youngs_modulus: 1, fibres: {stiffness: -1}}\nbodies: []\n", 2, {"stiffness is -1", "0 to 1e+12 Pa"}},
      {body + "    prestretch: 1.2\n", 3, {"prestretch is '1.2'", "{x: 1.1}"}},
      {body + "    prestretch: {}\n", 3, {"prestretch is empty", "one or two of x, y and z"}},
      {body + "    prestretch: {x: 3}\n", 3, {"x is 3", "0.5 to 2"}},
      {body + "    prestretch: {x: 1.1, y: 1, z: 1}\n", 3, {"all of x, y and z", "one or two"}},
      {body + "    up_axis: y\n", 3, {"up_axis of a primitive", "with a file"}},
      {body + "    up_axis: x\n", 3, {"up_axis is 'x'", "z, y"}},
      {body + "    pose: {positon: [0, 0, 0]}\n", 3, {"'positon'", "did you mean 'position'"}},
      {"materials:\n  a: {alhpa: 0.5}\nbodies: []\n", 2, {"'alhpa' in material 'a'", "did you mean 'alpha'"}},
      {"world: {step_rate: 0}\nbodies: []\n", 1, {"step_rate is 0", "1 to 10000 Hz"}},
      {"world: {step_rate: .nan}\nbodies: []\n", 1, {"step_rate is .nan", "1 to 10000"}},
      {"world: {step_rate: fast}\nbodies: []\n", 1, {"step_rate is 'fast'", "a number"}},
      {"world: {substeps: 1.5}\nbodies: []\n", 1, {"substeps is '1.5'", "whole number, 1 to 1000"}},
      {"world: {substeps: 99999999999}\nbodies: []\n", 1, {"substeps"}},
      {"world: {gravity: [0, 0]}\nbodies: []\n", 1, {"gravity is a list of 2", "a list of 3 numbers"}},
      {"world: {gravity: [0, 0, .inf]}\nbodies: []\n", 1, {"gravity[2] is .inf"}},
      {"world: {ground: down}\nbodies: []\n", 1, {"ground is 'down'", "or none"}},
      {"world: {ground: .nan}\nbodies: []\n", 1, {"ground is .nan"}},
      {"world: {sleep: maybe}\nbodies: []\n", 1, {"sleep is 'maybe'", "false, true"}},
      {"world: {contact: fast}\nbodies: []\n", 1, {"contact is 'fast'", "none, textbook"}},
      {"world: {pick: {stiffness: 0}}\nbodies: []\n", 1, {"stiffness is 0", "above 0"}},
      {"world: {push: {radius: -1}}\nbodies: []\n", 1, {"radius is -1"}},
      {"world: 5\nbodies: []\n", 1, {"world is '5'", "a map"}},
      {"world: {ground: 1, ground: 2}\nbodies: []\n", 1, {"the key 'ground' twice"}},
      {"materials:\n  a: {alpha: 1.5}\nbodies: []\n", 2, {"alpha is 1.5", "0 to 1"}},
      {"materials:\n  a: {mode: soft}\nbodies: []\n", 2, {"mode is 'soft'", "rigid, linear, quadratic"}},
      {"materials:\n  a: {density: 0}\nbodies: []\n", 2, {"density is 0", "above 0"}},
      {"materials:\n  a: {color: [1, 2, 0]}\nbodies: []\n", 2, {"color[1] is 2", "0 to 1"}},
      {"materials:\n  a: {color: red}\nbodies: []\n", 2, {"color is 'red'", "[red, green, blue]"}},
      {"materials:\n  'a b': {}\nbodies: []\n", 2, {"'a b'", "letters"}},
      {"world: {}\n", 1, {"bodies is absent", "a list"}},
      {"bodies: {a: 1}\n", 1, {"bodies is a map", "a list"}},
      {"bodies:\n  - name: a\n", 2, {"no file and no primitive"}},
      {"bodies:\n  - {file: ../cube.obj, primitive: {sphere: 1}}\n", 2, {"file and primitive"}},
      {body + "    scale: 0\n", 3, {"scale is 0", "above 0"}},
      {body + "    cavities: full\n", 3, {"cavities is 'full'", "empty, {pressure: Pa}"}},
      {body + "    cavities: {leak: 2}\n", 3, {"no pressure and no volume"}},
      {body + "    cavities: {pressure: 2, volume: 3}\n", 3, {"pressure, and volume"}},
      {body + "    cavities: {pressure: -2}\n", 3, {"pressure is -2", "0 to 1e+06 Pa"}},
      {body + "    cavities: {pressure: .nan}\n", 3, {"pressure is", "0 to 1e+06 Pa"}},
      {body + "    cavities: {volume: 0}\n", 3, {"volume is 0", "above 0 to 1e+09 ml"}},
      {body + "    cavities: {compliance: .inf}\n", 3, {"compliance is", "above 0 to 1e+06 ml/Pa"}},
      {body + "    cavities: {pressure: 2, leak: 0}\n", 3, {"leak is 0", "above 0 to 3600 s"}},
      {body + "    units: inch\n", 3, {"units", "inch", "m, cm, mm"}},
      {body + "    spacing: -0.1\n", 3, {"spacing is -0.1"}},
      {body + "    thickness: 0\n", 3, {"thickness is 0", "above 0"}},
      {body + "    thickness: .nan\n", 3, {"thickness is", "above 0"}},
      {body + "    resolution: high\n", 3, {"resolution", "high", "coarse, medium, fine"}},
      {body + "    spacing: 0.1\n    resolution: fine\n", 4, {"spacing and resolution", "one of them"}},
      {body + "    cells: half\n", 3, {"cells is 'half'", "filled"}},
      {body + "    repair: weld\n", 3, {"repair is 'weld'", "none, mend, wrap"}},
      {body + "    clusters: many\n", 3, {"clusters is 'many'", "auto, one"}},
      {body + "    clusters: {grid: [0, 1, 1]}\n", 3, {"grid[0] is '0'", "1 to"}},
      {body + "    clusters: {grid: [1000, 1000, 1000]}\n", 3, {"up to 100000 together"}},
      {body + "    clusters: {overlap: 0.5}\n", 3, {"no grid and no count"}},
      {body + "    clusters: {count: 3, overlap: 2}\n", 3, {"overlap is 2", "0 to 1"}},
      {body + "    material: wood\n", 3, {"unknown material 'wood'", "default"}},
      {body + "    pose: {rpy: [0, 0, 0], xyzw: [0, 0, 0, 1]}\n", 3, {"rpy and xyzw"}},
      {body + "    pose: {xyzw: [0, 0, 0, 0]}\n", 3, {"xyzw has the length 0"}},
      {body + "    regions: 5\n", 3, {"regions is '5'", "a list of up to 100"}},
      {body + "    regions: [{material: default}]\n", 3, {"no box, no sphere and no file"}},
      {body + "    regions: [{sphere: {centre: [0, 0, 0], radius: 1}}]\n", 3, {"has no material"}},
      {body + "    regions: [{sphere: {centre: [0, 0, 0], radius: 1}, material: wood}]\n",
       3,
       {"unknown material 'wood'"}},
      {body + "    regions: [{sphere: {centre: [0, 0, 0], radius: -1}, material: default}]\n",
       3,
       {"radius is -1", "above 0"}},
      {body + "    regions: [{file: ../none.obj, material: default}]\n", 3, {"none.obj"}},
      {body + "    fixed: [{ball: 1}]\n", 3, {"'ball'", "did you mean 'box'"}},
      {body + "    fixed: [{box: {min: [0, 0, 0]}}]\n", 3, {"no min or no max"}},
      {body + "    fixed: [{box: {min: [0, 0, 1], max: [0, 0, 0]}}]\n", 3, {"min above its max"}},
      {body + "    fixed: [{plane: {point: [0, 0, 1]}}]\n", 3, {"no point or no normal"}},
      {body + "    fixed: [{plane: {point: [0, 0, 1], normal: [0, 0, 0]}}]\n", 3, {"normal has the length 0"}},
      {body + "    fixed: [{sphere: {centre: [0, 0, 1], radius: 0}}]\n", 3, {"radius is 0", "above 0"}},
      {body + "    fixed: [{sphere: {centre: [0, 0, 1], radius: 1}, plane: {point: [0, 0, 1], normal: [0, 0, 1]}}]\n",
       3,
       {"several shapes"}},
      {body + "    fixed: [{sphere: {centre: [0, 0, 1], radius: 1}, frame: wrold}]\n", 3, {"wrold", "world"}},
      {body + "    fixed: [{sphere: {centre: [0, 0, 1], radius: 1}, follows: ''}]\n", 3, {"follows is ''", "a text"}},
      {body + "    fixed: [{sphere: {centre: [0, 0, 1], radius: 1}, follows: my arm}]\n", 3, {"my arm", "a frame of tf"}},
      {body + "    material: {young: 5000, alpha: 0.5}\n", 3, {"alpha beside young"}},
      {body + "    material: {youngs_modulus: 5000, alpha: 0.5}\n", 3, {"alpha beside youngs_modulus"}},
      {body + "    material: {youngs_modulus: 5000, young: 5000}\n", 3, {"young and youngs_modulus"}},
      {body + "    copies: {}\n", 3, {"no count and no grid"}},
      {body + "    copies: {count: 9, grid: [2, 2, 2]}\n", 3, {"8 places", "9 to"}},
      {body + "    copies: {grid: [100, 100, 100]}\n", 3, {"1000000 places"}},
      {body + "    name: 'a/b'\n", 2, {"'a/b'", "letters"}},
      {body + "  - primitive: {sphere: 0.1}\n", 3, {"two bodies are named 'sphere'"}},
      {"bodies:\n  - primitive: {sphere: 0}\n", 2, {"sphere is 0", "0.0001 to 1000"}},
      {"bodies:\n  - primitive: {cube: 1}\n", 2, {"'cube'", "did you mean 'box'"}},
      {"bodies:\n  - primitive: {box: [1, 1]}\n", 2, {"box is a list of 2"}},
      {"bodies:\n  - {primitive: {box: [1, 1, 1]}, edge: 0.00001}\n", 2, {"edge is 1e-05, too short"}},
      {"bodies:\n  - file: ../none.obj\n", 2, {"no file '../none.obj'"}},
      {"bodies:\n  - file: /etc/passwd\n", 2, {"outside the folders"}},
      {"bodies:\n  - file: [a]\n", 2, {"file is a list of 1", "a text"}},
      {"bodies: []\n...\n---\nbodies: []\n", 0, {"more than one document"}},
      {"bodies: [\n", 2, {"YAML"}},
      {"? [a, b]\n: 1\n", 1, {"a key of the scene is a list"}},
      {"", 0, {"a map"}},
  };
  for (const Case& one : cases) {
    const Error error = bad(one.text);
    for (const std::string& word : one.words) EXPECT_TRUE(says(error, word)) << one.text << error.detail;
    const std::string place =
        folder.file("scenes/s.yaml") + (one.line > 0 ? ":" + std::to_string(one.line) + ": " : "");
    EXPECT_EQ(error.detail.compare(0, place.size(), place), 0) << one.text << error.detail;
  }
}

TEST_F(Scene, AnotherFileThatIsNamedIsNotShown) {
  for (const char* text : {"root:x:0:0:root:/root:/bin/bash\n", "- root\n- x\n", "{root\n"}) {
    const Error error = bad(text);
    EXPECT_FALSE(says(error, "root")) << error.detail;
  }
  EXPECT_TRUE(says(bad("root:x:0:0\n"), "the scene is not a map"));
}

TEST_F(Scene, ErrorsHaveTheirCodes) {
  EXPECT_EQ(bad("bodies: [{file: /etc/passwd}]\n").code, ErrorCode::kForbidden);
  EXPECT_EQ(bad("bodies: [{file: none.obj}]\n").code, ErrorCode::kUnreadable);
  EXPECT_EQ(bad("bodies: [{primitive: {sphere: 1}, material: wood}]\n").code, ErrorCode::kUnknownName);
  EXPECT_EQ(bad("bodies: [{primitive: {sphere: 1}}, {primitive: {sphere: 1}}]\n").code, ErrorCode::kDuplicateName);
  EXPECT_EQ(bad("world: {substeps: 0}\n").code, ErrorCode::kInvalidArgument);
  for (const char* key : {"youngs_modulus: -5000", "poissons_ratio: 0.5"}) {
    const Error error = bad(std::string("materials:\n  soft: {") + key + "}\nbodies: []\n");
    EXPECT_EQ(error.code, ErrorCode::kInvalidArgument);
    EXPECT_TRUE(says(error, "s.yaml:2: ")) << error.detail;
  }
  const Result<SceneDef> missing = readScene(folder.file("scenes/none.yaml"), access);
  ASSERT_FALSE(missing.ok());
  EXPECT_EQ(missing.error().code, ErrorCode::kUnreadable);
  EXPECT_FALSE(readScene(folder.path(), access).ok());
}

TEST_F(Scene, BombsAreDefused) {
  EXPECT_TRUE(says(bad(std::string((1 << 20) + 1, '#')), "1 MiB"));
  EXPECT_TRUE(says(bad("bodies: " + std::string(100000, '[')), "deep"));
  EXPECT_TRUE(says(bad(std::string(400000, '-') + " a"), "s.yaml"));
  std::string dashes;
  for (int k = 0; k < 100000; ++k) dashes += "- ";
  EXPECT_TRUE(says(bad(dashes), "deep"));
  std::string laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";
  for (int k = 1; k < 12; ++k) {
    const std::string last = "*a" + std::to_string(k - 1);
    laughs += "a" + std::to_string(k) + ": &a" + std::to_string(k) + " [" + last;
    for (int j = 0; j < 9; ++j) laughs += ", " + last;
    laughs += "]\n";
  }
  EXPECT_TRUE(says(bad(laughs + "bodies: []\n"), "aliases"));
  // Ordinary anchors serve.
  const SceneDef scene = good(
      "bodies:\n  - {name: a, primitive: {sphere: 1}, fixed: &hold [{box: {min: [0, 0, 0], max: [1, 1, 1]}}]}\n"
      "  - {name: b, primitive: {sphere: 1}, fixed: *hold}\n");
  EXPECT_EQ(scene.bodies[1].fixed.size(), 1u);
}

TEST_F(Scene, MaterialsAreKnownFromThePackageTheFolderBesideAndTheSceneItself) {
  folder.write("package/config/materials/a.yaml", "soft: {alpha: 0.1}\nfirm: {alpha: 0.8}\nown: {alpha: 0.7}\n");
  folder.write("materials/a.yaml", "firm: {alpha: 0.85}\nown: {alpha: 0.75}\n");
  folder.write("materials/b.yaml", "# only words\n");
  folder.write("materials/notes.txt", "no: material\n");
  access.find_package = [this](const std::string& name) {
    return name == "meshless_surgery" ? folder.file("package") : std::string();
  };
  const SceneDef scene = good(
      "materials: {own: {alpha: 0.95}}\nbodies:\n  - {name: a, primitive: {sphere: 1}, material: soft}\n"
      "  - {name: b, primitive: {sphere: 1}, material: firm}\n  - {name: c, primitive: {sphere: 1}, material: own}\n");
  ASSERT_EQ(scene.bodies.size(), 3u);
  EXPECT_EQ(scene.bodies[0].material.alpha, 0.1);
  EXPECT_EQ(scene.bodies[1].material.alpha, 0.85);
  EXPECT_EQ(scene.bodies[2].material.alpha, 0.95);
  EXPECT_EQ(scene.materials.size(), 3u);
  // A folder beside the scene that may not be read is not.
  access.folders = {folder.file("package")};
  const SceneDef without = good("bodies: [{primitive: {sphere: 1}, material: firm}]\n");
  EXPECT_EQ(without.bodies[0].material.alpha, 0.8);
  // That it is not is said, above all where a name is missing for it.
  ASSERT_EQ(without.warnings.size(), 1u);
  const std::string skipped = "the materials in '" + folder.file("materials") + "' are not read: '";
  EXPECT_EQ(without.warnings[0].find(skipped), 0u) << without.warnings[0];
  folder.write("materials/a.yaml", "firmer: {alpha: 0.85}\n");
  const Error missing = bad("bodies: [{primitive: {sphere: 1}, material: firmer}]\n");
  EXPECT_TRUE(says(missing, "unknown material 'firmer'")) << missing.detail;
  EXPECT_TRUE(says(missing, skipped)) << missing.detail;
  // A fault in a file of materials is named with that file.
  folder.write("package/config/materials/z.yaml", "soft:\n  alpha: 2\n");
  EXPECT_TRUE(says(bad("bodies: []\n"), "z.yaml:2: alpha is 2"));
}

TEST_F(Scene, NotesOfTheMeshArePassedOn) {
  TriangleMesh inside_out = boxMesh(Vec3(1, 1, 1), 1, 1, 1);
  for (Triangle& t : inside_out.triangles) std::swap(t[0], t[1]);
  ASSERT_TRUE(writeObj(folder.file("turned.obj"), inside_out, "").ok());
  const SceneDef scene = good("bodies: [{file: ../turned.obj}]\n");
  EXPECT_FALSE(scene.bodies[0].notes.empty());
  EXPECT_GT(signedVolume(scene.bodies[0].mesh), 0.0);
}

Result<Material> changed(const Material& base, const std::string& yaml) {
  ImageFiles images{FileAccess()};
  std::vector<std::string> warnings;
  return changeMaterial(base, yaml, images, "", warnings);
}

TEST(ChangeMaterial, ChangesTheKeysItIsGiven) {
  Material base;
  base.name = "mine";
  base.density = 900.0;
  const Result<Material> rigid = changed(base, "{alpha: 0.9, mode: rigid}");
  ASSERT_TRUE(rigid.ok()) << rigid.error().detail;
  EXPECT_EQ(rigid->name, "mine");
  EXPECT_EQ(rigid->alpha, 0.9);
  EXPECT_EQ(rigid->mode, MatchMode::kRigid);
  EXPECT_EQ(rigid->density, 900.0);
  const Result<Material> held = changed(base, "{volume: [[0, 0.1], [0.2, 1]], area: 0.5}");
  ASSERT_TRUE(held.ok()) << held.error().detail;
  EXPECT_NEAR(held->volume.at(0.1), 0.55, 1e-15);
  EXPECT_EQ(held->area.at(3.0), 0.5);
  EXPECT_TRUE(changed(*held, "volume: none")->volume.points.empty());
  const Result<Material> patterned = changed(base, "appearance: {outer: {noise: fat, scale: 0.01}}");
  ASSERT_TRUE(patterned.ok());
  const Result<Material> coarser = changed(*patterned, "appearance: {outer: {scale: 0.02}}");
  ASSERT_TRUE(coarser.ok());
  EXPECT_EQ(Noise::kFat, coarser->appearance.outer.noise);
  EXPECT_EQ(0.02, coarser->appearance.outer.scale);
  EXPECT_TRUE(changed(*coarser, "appearance: none")->appearance == Appearance());
}

TEST(ChangeMaterial, RefusesWhatItDoesNotKnow) {
  const Material base;
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"alpha: 2", "material:1: alpha is 2"},
      {"alpha: .nan", "alpha is .nan"},
      {"alhpa: 0.5", "did you mean 'alpha'"},
      {"beta: 0.5\ndensity: -1", "material:2: density is -1"},
      {"0.5", "a map"},
      {"", "no key"},
      {"{}", "no key"},
      {"{alpha: ", "YAML"},
      {"youngs_modulus: -1", "youngs_modulus is -1"},
      {"volume: [[0, 0.5], [0.1, 0.2]]", "volume[1][1] is 0.2"},
      {"area: [0.5]", "area[0] is '0.5'"},
      {"volume: 2", "volume is 2"},
      {"area: loose", "area is 'loose'"},
      {"plasticity: {creep: -1}", "creep is -1"},
      {"plasticity: {yeild: 1}", "did you mean 'yield'"},
      {"plasticity: {maximum: 4}", "maximum is 4"},
      {"plasticity: 3", "plasticity is '3'"},
      {"appearance: 3", "appearance is '3'"},
      {"appearance: {outer: 3}", "outer is"},
      {"appearance: {outside: {}}", "unknown key 'outside'"},
      {"appearance: {outer: {noise: [fat]}}", "noise is"},
      {"appearance: {outer: {image: [a.png]}}", "image is"},
      {"appearance: {inner: {scale: 0}}", "scale is 0"},
      {"appearance: {inner: {scale: .nan}}", "scale is"},
      {"appearance: {inner: {wetness: 1.5}}", "wetness is 1.5"},
      {"appearance: {inner: {bump: -1}}", "bump is -1"},
      {"appearance: {inner: {second: [0.1, 2, 0.1]}}", "second[1] is 2"},
      {"youngs_modulus: 1e4\npoissons_ratio: 0.5", "material:2: poissons_ratio is 0.5"},
      {"name: other", "unknown key 'name'"}};
  for (const auto& one : cases) {
    const Result<Material> refused = changed(base, one.first);
    ASSERT_FALSE(refused.ok()) << one.first;
    EXPECT_TRUE(says(refused.error(), one.second)) << refused.error().detail;
  }
}

TEST(ChangeMaterial, RefusesAKeyThatWouldChangeNothing) {
  Material looks, elastic;
  elastic.name = "soft";
  elastic.youngs_modulus = 5000.0;
  const std::vector<std::string> of_looks = {"alpha: 0.5", "beta: 0.5", "mode: rigid"},
                                 of_elastic = {"poissons_ratio: 0.3"};
  for (const std::string& key : of_looks) {
    const Result<Material> refused = changed(elastic, "damping: 3\n" + key);
    ASSERT_FALSE(refused.ok()) << key;
    EXPECT_TRUE(says(refused.error(), "material:2: " + key.substr(0, key.find(':')) + " is "))
        << refused.error().detail;
    EXPECT_TRUE(says(refused.error(), "elastic material like 'soft'")) << refused.error().detail;
    EXPECT_TRUE(changed(looks, key).ok()) << key;
    EXPECT_TRUE(changed(elastic, "youngs_modulus: 0\n" + key).ok()) << key << ": it is of the other kind then";
  }
  for (const std::string& key : of_elastic) {
    EXPECT_FALSE(changed(looks, key).ok()) << key;
    EXPECT_TRUE(changed(elastic, key).ok()) << key;
    EXPECT_TRUE(changed(looks, "youngs_modulus: 5000\n" + key).ok()) << key << ": it is of the other kind then";
  }
}

TEST(ReadMaterials, AFolderThatIsMissingIsUnreadable) {
  const Result<std::map<std::string, Material>> read = readMaterials("/no/such/folder");
  ASSERT_FALSE(read.ok());
  EXPECT_EQ(read.error().code, ErrorCode::kUnreadable);
}

TEST(PrimitiveMesh, IsClosedAndOfItsSize) {
  const double pi = 3.14159265358979;
  struct Case {
    std::string kind;
    std::vector<double> sizes;
    double volume;
  };
  for (const Case& one : std::vector<Case>{{"box", {0.1, 0.2, 0.3}, 0.006},
                                           {"sphere", {0.1}, 4.0 / 3.0 * pi * 1e-3},
                                           {"cylinder", {0.3, 0.05}, pi * 0.0025 * 0.3}}) {
    const Result<TriangleMesh> mesh = primitiveMesh(one.kind, one.sizes);
    ASSERT_TRUE(mesh.ok()) << mesh.error().detail;
    EXPECT_TRUE(inspectMesh(*mesh).closed());
    EXPECT_NEAR(signedVolume(*mesh), one.volume, 0.05 * one.volume);
    EXPECT_GT(mesh->triangles.size(), 200u);
    EXPECT_LT(mesh->triangles.size(), 1800u);
    const Result<TriangleMesh> finer = primitiveMesh(one.kind, one.sizes, 0.5 * meanEdgeLength(*mesh));
    ASSERT_TRUE(finer.ok());
    EXPECT_GT(finer->triangles.size(), 2 * mesh->triangles.size());
  }
}

TEST(PrimitiveMesh, RefusesOtherKindsAndSizes) {
  for (const std::vector<double>& sizes : std::vector<std::vector<double>>{{}, {0.0}, {-1.0}, {1e9}, {NAN}, {1, 1}})
    EXPECT_FALSE(primitiveMesh("sphere", sizes).ok());
  EXPECT_FALSE(primitiveMesh("cone", {1.0}).ok());
  EXPECT_FALSE(primitiveMesh("sphere", {1.0}, NAN).ok());
  EXPECT_FALSE(primitiveMesh("sphere", {1.0}, 1e-6).ok());
}

// --- what the package ships

struct Shipped : ::testing::Test {
  FileAccess access;
  const std::string package = SOURCE_DIR;

  void SetUp() override {
    access.folders = {package};
    access.find_package = [this](const std::string& name) { return name == "meshless_surgery" ? package : ""; };
  }
  SceneDef scene(const std::string& name) {
    Result<SceneDef> read = readScene(package + "/config/scenes/" + name + ".yaml", access);
    EXPECT_TRUE(read.ok()) << (read.ok() ? "" : read.error().detail);
    return read.ok() ? *read : SceneDef{};
  }
};

TEST_F(Shipped, MaterialsArePlausible) {
  const Result<std::map<std::string, Material>> materials = readMaterials(package + "/config/materials");
  ASSERT_TRUE(materials.ok()) << materials.error().detail;
  for (const char* name : {"default", "liver", "kidney", "fish", "skin", "fat", "jelly", "rubber"}) {
    ASSERT_EQ(materials->count(name), 1u) << name;
    const Material& material = materials->at(name);
    EXPECT_EQ(material.name, name);
    EXPECT_TRUE(material.validate().ok());
    EXPECT_GT(material.density, 800.0);
    EXPECT_LT(material.density, 1300.0);
    // A cut shows: the two colours differ.
    EXPECT_GT(std::abs(material.color.r - material.inside_color.r) +
                  std::abs(material.color.g - material.inside_color.g) +
                  std::abs(material.color.b - material.inside_color.b),
              0.2f)
        << name;
  }
}

TEST_F(Shipped, ScenesLoadAsClosedBodiesAboveTheGround) {
  const std::vector<std::pair<std::string, std::size_t>> scenes = {
      {"liver", 1}, {"fish", 1}, {"skin", 1}, {"block", 1}, {"pile", 1000}};
  for (const auto& one : scenes) {
    const SceneDef def = scene(one.first);
    ASSERT_EQ(def.bodies.size(), one.second) << one.first;
    EXPECT_EQ(def.name, one.first);
    for (const BodyDef& body : def.bodies) {
      EXPECT_TRUE(body.solid) << one.first;
      EXPECT_TRUE(body.notes.empty()) << one.first << ": " << (body.notes.empty() ? "" : body.notes[0]);
      for (const Vec3& p : body.mesh.vertices) EXPECT_GE((body.pose * p).z(), def.world.ground.value_or(-1.0));
    }
  }
}

TEST_F(Shipped, EveryBodyOfEverySceneHasALook) {
  int scenes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(package + "/config/scenes")) {
    ++scenes;
    const SceneDef def = scene(entry.path().stem().string());
    for (const BodyDef& body : def.bodies) {
      EXPECT_NE(Look{}, body.material.appearance.outer) << def.name << ": " << body.name;
      EXPECT_NE(Look{}, body.material.appearance.inner) << def.name << ": " << body.name;
      for (const auto& region : body.regions)
        EXPECT_NE(Look{}, region.material.appearance.inner) << def.name << ": " << body.name;
    }
  }
  EXPECT_GT(scenes, 10);
}

TEST_F(Shipped, TheLiverIsElasticUnderBothItsNamesAndTheOtherForLooks) {
  const SceneDef liver = scene("liver"), looks = scene("liver_looks");
  ASSERT_EQ(liver.bodies.size(), 1u);
  ASSERT_EQ(looks.bodies.size(), 1u);
  EXPECT_TRUE(liver.bodies[0].material.elastic());
  EXPECT_FALSE(looks.bodies[0].material.elastic());
  EXPECT_EQ(liver.bodies[0].mesh.vertices, looks.bodies[0].mesh.vertices);
  EXPECT_EQ(std::filesystem::canonical(package + "/config/scenes/elastic_liver.yaml"),
            std::filesystem::canonical(package + "/config/scenes/liver.yaml"));
}

TEST_F(Shipped, FixedRegionsHoldAPartOfTheBody) {
  for (const auto& one : std::vector<std::array<double, 2>>{{{0.03, 0.3}}, {{0.05, 0.3}}}) {
    const bool is_liver = one[0] == 0.03;
    const SceneDef def = scene(is_liver ? "liver" : "skin");
    ASSERT_EQ(def.bodies.size(), 1u);
    std::size_t held = 0;
    for (const Vec3& p : def.bodies[0].mesh.vertices)
      held += std::any_of(def.bodies[0].fixed.begin(), def.bodies[0].fixed.end(),
                          [&](const HeldRegion& fixed) { return fixed.region.contains(def.bodies[0].pose * p); });
    const double share = static_cast<double>(held) / static_cast<double>(def.bodies[0].mesh.vertices.size());
    EXPECT_GT(share, one[0]) << def.name;
    EXPECT_LT(share, one[1]) << def.name;
  }
}

TEST_F(Shipped, BlocksHaveExactlyOneInnerParticle) {
  const BodyDef block = scene("block").bodies.at(0);
  EXPECT_EQ(block.mesh.triangles.size(), 32u);
  const SolidQuery solid(block.mesh);
  const LatticeSample inner = sampleInterior(block.mesh, solid, block.spacing, 0.5 * block.spacing);
  ASSERT_EQ(inner.points.size(), 1u);
  EXPECT_LT(inner.points[0].norm(), 1e-6);
}

TEST_F(Shipped, ThePileStartsWithoutOverlap) {
  const SceneDef pile = scene("pile");
  std::vector<Box> bounds;
  for (const BodyDef& body : pile.bodies) {
    Box box;
    for (const Vec3& p : body.mesh.vertices) box.extend(body.pose * p);
    for (const Box& other : bounds) EXPECT_FALSE(box.overlaps(other));
    bounds.push_back(box);
  }
}

}  // namespace scene_test
}  // namespace meshless
