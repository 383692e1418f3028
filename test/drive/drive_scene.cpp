#include "drive/drive_scene.h"

#include <algorithm>
#include <cmath>

#include "meshless_surgery/base/random.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "shapes/organs.h"
#include "meshless_surgery/geometry/mesh/primitives.h"
#include "shapes/random_organ.h"
#include "drive/supports.h"
#include "drive/words.h"

namespace meshless {
namespace {

// Each purpose draws from a sequence of its own; organ k has kOrgan + k.
enum Purpose : std::uint64_t { kWhole = 1, kPlaces = 2, kShape = 100, kMatter = 200 };

constexpr double kSmallest = 0.05, kLargest = 0.3;  // [m]
constexpr double kFewest = 500.0, kMost = 30000.0;  // triangles
constexpr double kMostPressed = 0.04;               // change of volume by its own weight
constexpr double kGravity = 9.81;                   // [m/s^2]

struct Shape {
  TriangleMesh mesh;
  std::string words;
};

double largestEdge(const TriangleMesh& mesh) {
  const Box box = boundsOf(mesh.vertices);
  return (box.max - box.min).maxCoeff();
}

void scaleTo(TriangleMesh& mesh, double size) {
  const double scale = size / largestEdge(mesh);
  for (Vec3& p : mesh.vertices) p *= scale;
}

/// Edge of equilateral triangles of which `count` cover `area`.
double edgeFor(double area, double count) { return std::sqrt(area / (count * 0.25 * std::sqrt(3.0))); }

Shape primitive(Random& random, double size, double triangles) {
  Shape shape;
  switch (random.whole(0, 3)) {
    case 0: {
      const Vec3 edges = size * Vec3(1.0, random.between(0.3, 1.0), random.between(0.15, 0.8));
      const double area = 2.0 * (edges.x() * edges.y() + edges.y() * edges.z() + edges.z() * edges.x());
      shape = {boxMesh(edges, edgeFor(area, triangles)), "box"};
      break;
    }
    case 1: {
      const double radius = 0.5 * size;
      shape = {sphereMesh(radius, edgeFor(12.57 * radius * radius, triangles)), "sphere"};
      break;
    }
    case 2: {
      const double radius = size * random.between(0.1, 0.45);
      shape = {cylinderMesh(size, radius, edgeFor(6.28 * radius * (size + radius), triangles)), "cylinder"};
      break;
    }
    default: {
      const double tube = size * random.between(0.1, 0.2), ring = 0.5 * size - tube;
      shape = {torusMesh(ring, tube, edgeFor(39.5 * ring * tube, triangles)), "torus"};
      break;
    }
  }
  return shape;
}

Result<Shape> makeShape(Random& random, double most_triangles) {
  const double size = random.logBetween(kSmallest, kLargest),
               triangles = std::min(random.logBetween(kFewest, kMost), most_triangles);
  const double kind = random.between(0.0, 1.0);
  Shape shape;
  if (kind < 0.6) {
    const int genus = random.whole(0, 3);
    const std::uint64_t seed = random.bits();
    Result<TriangleMesh> mesh = randomOrgan(seed, genus, size, static_cast<std::size_t>(triangles));
    // Some take more than they were asked for, to show their rings.
    for (double fewer = 0.7; mesh && mesh->triangles.size() > static_cast<std::size_t>(most_triangles); fewer *= 0.7)
      mesh = randomOrgan(seed, genus, size, static_cast<std::size_t>(fewer * triangles));
    if (!mesh) return mesh.error();
    shape = {std::move(*mesh), words("organ of genus ", genus)};
  } else if (kind < 0.8) {
    const unsigned seed = static_cast<unsigned>(random.bits() % 1000);
    switch (random.whole(0, 4)) {
      case 0:
        shape = {liverMesh(seed), "liver"};
        break;
      case 1:
        shape = {kidneyMesh(seed), "kidney"};
        break;
      case 2:
        shape = {fishMesh(seed), "fish"};
        break;
      case 3:
        shape = {skinSlabMesh(), "skin"};
        break;
      default:
        shape = {block32Mesh(), "block"};
        break;
    }
    scaleTo(shape.mesh, size);
  } else {
    shape = primitive(random, size, triangles);
  }
  shape.words += words(" ", std::round(1000.0 * largestEdge(shape.mesh)), " mm ", shape.mesh.triangles.size());
  return shape;
}

Material randomMaterial(Random& random, bool elastic, double size) {
  Material material;
  material.density = random.between(900.0, 1200.0);
  material.damping = random.logBetween(0.5, 10.0);
  material.friction = random.between(0.1, 1.0);
  if (elastic) {
    material.name = "random_elastic";
    material.poissons_ratio = random.between(0.3, 0.49);
    const double weight = material.density * kGravity * size;  // [Pa] under its own height
    const double softest = std::max({1e3, weight, weight * 0.5 * (1.0 - 2.0 * material.poissons_ratio) / kMostPressed});
    material.youngs_modulus = std::max(softest, random.logBetween(1e3, 2e5));
  } else {
    material.name = "random_looks";
    material.mode = static_cast<MatchMode>(random.whole(0, 2));
    material.alpha = random.between(0.3, 1.0);
    material.beta = random.between(0.0, 0.6);
  }
  return material;
}

Material makeMaterial(Random& random, const DriveChoices& choices, double size) {
  // All that the free choice draws is drawn whatever was chosen, so that what follows stays the same.
  const bool shipped = random.chance(0.5) && !choices.shipped.empty(), elastic = random.chance(0.5);
  const std::uint64_t which = random.bits();
  std::vector<const Material*> candidates;
  for (const auto& [name, material] : choices.shipped) {
    const bool stiffens = material.stiffening != 0.0 || material.asymmetry != 0.0;
    if (stiffens && choices.material != name) continue;  // those came later: a seed stays its scene
    if (choices.material.empty() || choices.material == name ||
        (choices.material == "elastic" ? material.elastic() : choices.material == "looks" && !material.elastic()))
      candidates.push_back(&material);
  }
  const bool family = choices.material == "elastic" || choices.material == "looks";
  if (!candidates.empty() && (shipped || (!choices.material.empty() && !family)))
    return *candidates[which % candidates.size()];
  return randomMaterial(random, family ? choices.material == "elastic" : elastic, size);
}

struct Organ {
  BodyDef def;
  Box bounds;  // of the turned mesh about its own origin
  Vec3 extent() const { return bounds.max - bounds.min; }
};

/// Moves it so that its bounds have this middle in x and y and this lower end.
void place(Organ& organ, double x, double y, double bottom) {
  const Vec3 middle = 0.5 * (organ.bounds.min + organ.bounds.max);
  organ.def.pose.translation = Vec3(x - middle.x(), y - middle.y(), bottom - organ.bounds.min.z());
}

/// In a row along x about the origin; returns its half length.
double placeInRow(std::vector<Organ>& organs, Random& random, double bottom) {
  double length = 0.0;
  for (const Organ& organ : organs) length += organ.extent().x();
  const double gap = random.between(0.002, 0.02);
  length += gap * static_cast<double>(organs.size() - 1);
  double x = -0.5 * length;
  for (Organ& organ : organs) {
    place(organ, x + 0.5 * organ.extent().x(), random.between(-0.2, 0.2) * organ.extent().y(), bottom);
    x += organ.extent().x() + gap;
  }
  return 0.5 * length;
}

/// On each other, aside by up to `aside` of their extent.
void placeInStack(std::vector<Organ>& organs, Random& random, double bottom, double aside) {
  for (Organ& organ : organs) {
    const Vec3 off = aside * organ.extent().cwiseProduct(random.inCube(1.0));
    place(organ, off.x(), off.y(), bottom);
    bottom += organ.extent().z() + 0.005;
  }
}

void placeOrgans(std::vector<Organ>& organs, Random& random, DriveScene& scene) {
  const double drop = random.logBetween(0.002, 0.2);
  Vec3 widest = Vec3::Zero();
  for (const Organ& organ : organs) widest = widest.cwiseMax(organ.extent());
  if (scene.support == "stack") {
    placeInStack(organs, random, drop, 0.25);
  } else if (scene.support == "bowl") {
    const double radius = random.between(0.5, 1.0) * widest.norm(), depth = random.between(0.3, 0.8) * radius;
    const double wall = 0.01;
    scene.def.obstacles.push_back({"bowl", bowlMesh(radius, depth, wall), random.between(0.2, 0.8), {}});
    placeInStack(organs, random, wall + depth + 0.005, 0.05);
  } else if (scene.support == "tray") {
    const double wall = 0.01, rim = random.between(0.02, 0.05);
    const double length = placeInRow(organs, random, wall + rim + drop);
    const double half = std::max(length, 0.7 * widest.y()) + 0.02;
    scene.def.obstacles.push_back({"tray", trayMesh(half, rim, wall), random.between(0.2, 0.8), {}});
  } else if (scene.support == "hung") {
    placeInRow(organs, random, random.between(0.02, 0.15));
    for (Organ& organ : organs) {
      Box held;
      for (const Vec3& corner : {organ.bounds.min, organ.bounds.max}) held.extend(corner + organ.def.pose.translation);
      held.min.z() = held.max.z() - random.between(0.12, 0.25) * organ.extent().z();
      held.min.array() -= Vec3(0.05, 0.05, 0.0).array();
      held.max.array() += 0.05;
      organ.def.fixed.push_back(held);
    }
  } else {
    placeInRow(organs, random, drop);
  }
}

Status check(const DriveChoices& choices) {
  if (!(choices.most_organs >= 1 && choices.most_organs <= 3))
    return Error{ErrorCode::kInvalidArgument, words("most_organs is ", choices.most_organs, "; accepted: 1 to 3")};
  if (!(choices.most_triangles >= kFewest && choices.most_triangles <= kMost))
    return Error{ErrorCode::kInvalidArgument,
                 words("most_triangles is ", choices.most_triangles, "; accepted: ", kFewest, " to ", kMost)};
  if (!choices.support.empty() && std::find(kSupports.begin(), kSupports.end(), choices.support) == kSupports.end()) {
    std::string accepted;
    for (const char* name : kSupports) accepted += (accepted.empty() ? "" : ", ") + std::string(name);
    return Error{ErrorCode::kUnknownName, "support is '" + choices.support + "'; accepted: " + accepted};
  }
  if (!choices.material.empty() && choices.material != "elastic" && choices.material != "looks" &&
      !choices.shipped.count(choices.material)) {
    std::string accepted = "elastic, looks";
    for (const auto& [name, material] : choices.shipped) accepted += ", " + name;
    return Error{ErrorCode::kUnknownName, "material is '" + choices.material + "'; accepted: " + accepted};
  }
  return Done{};
}

}  // namespace

Result<DriveScene> makeDriveScene(std::uint64_t seed, const DriveChoices& choices) {
  if (const Status status = check(choices); !status) return status.error();
  DriveScene scene;
  scene.seed = seed;
  scene.def.name = "drive_" + std::to_string(seed);
  if (choices.contact) scene.def.world.contact = *choices.contact;
  Random whole(seed, kWhole);
  const int count = std::min(whole.whole(1, 3), choices.most_organs);
  scene.support = kSupports[static_cast<std::size_t>(whole.whole(0, static_cast<int>(kSupports.size()) - 1))];
  if (!choices.support.empty()) scene.support = choices.support;
  if (scene.support == "stack" && count == 1) scene.support = "ground";
  std::vector<Organ> organs;
  for (std::uint64_t k = 0; k < static_cast<std::uint64_t>(count); ++k) {
    Random shapes(seed, kShape + k), matter(seed, kMatter + k);
    Result<Shape> shape = makeShape(shapes, choices.most_triangles);
    if (!shape) return shape.error();
    Organ organ;
    organ.def.name = "organ_" + std::to_string(k + 1);
    organ.def.mesh = std::move(shape->mesh);
    organ.def.pose.rotation = shapes.rotation();
    organ.def.material = makeMaterial(matter, choices, largestEdge(organ.def.mesh));
    for (const Vec3& p : organ.def.mesh.vertices) organ.bounds.extend(organ.def.pose.rotation * p);
    scene.organs.push_back(shape->words);
    organs.push_back(std::move(organ));
  }
  Random places(seed, kPlaces);
  placeOrgans(organs, places, scene);
  for (Organ& organ : organs) scene.def.bodies.push_back(std::move(organ.def));
  return scene;
}

}  // namespace meshless
