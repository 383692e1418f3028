#include "shapes/random_organ.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "shapes/implicit_shapes.h"
#include "meshless_surgery/geometry/mesh/isosurface.h"
#include "meshless_surgery/base/random.h"
#include "meshless_surgery/geometry/mesh/measures.h"
#include "meshless_surgery/geometry/mesh/mesh_check.h"

namespace meshless {
namespace {

constexpr int kTries = 400, kRefinements = 4;
constexpr int kRelaxations = 12;         // of the surface's vertices: enough for even triangles
constexpr double kTrianglesPerCell = 3;  // triangles of a surface net in a cell's square of area, over all directions
constexpr std::size_t kDraft = 4000;     // triangles of the mesh that shows genus and area

struct Blob {
  Vec3 centre, radii;
  Mat3 turn;
};
/// A torus about z in its own frame.
struct Ring {
  Vec3 centre;
  Mat3 turn;
  double ring_radius, tube_radius;
};

/// About a unit large.
struct Organ {
  std::vector<Blob> blobs;
  std::vector<Ring> rings;
  double fillet = 0.1, unevenness = 0.02;
  Unevenness waves;
  Box bounds;

  explicit Organ(std::uint64_t seed) : waves(static_cast<unsigned>(seed), 0.5) {}

  double at(const Vec3& p) const {
    double d = 1e9;
    for (const Blob& blob : blobs) d = blend(d, ellipsoid(blob.turn * (p - blob.centre), blob.radii), fillet);
    for (const Ring& ring : rings) {
      const Vec3 q = ring.turn * (p - ring.centre);
      const double tube = std::hypot(std::hypot(q.x(), q.y()) - ring.ring_radius, q.z()) - ring.tube_radius;
      d = blend(d, tube, 0.5 * fillet);
    }
    return d + unevenness * waves.at(p);
  }
};

Organ makeOrgan(std::uint64_t seed, int genus) {
  Random random(seed);
  Organ organ(random.bits());
  organ.fillet = random.between(0.06, 0.25);
  organ.unevenness = random.between(0.0, 0.03);
  const int blobs = random.whole(2, 5);
  for (int k = 0; k < blobs; ++k) {
    Blob blob;
    const double size = k == 0 ? 0.5 : random.between(0.25, 0.45);
    blob.radii = size * Vec3(1.0, random.between(0.5, 1.0), random.between(0.4, 0.9));
    blob.turn = random.rotation().toRotationMatrix();
    // Its centre in another one's skin, so that they hang together.
    blob.centre = Vec3::Zero();
    if (k > 0) {
      const Blob& other = organ.blobs[static_cast<std::size_t>(random.whole(0, k - 1))];
      blob.centre = other.centre + other.turn.transpose() * other.radii.cwiseProduct(random.direction());
    }
    organ.blobs.push_back(blob);
  }
  for (int k = 0; k < genus; ++k) {
    Ring ring;
    ring.ring_radius = random.between(0.25, 0.4);
    ring.tube_radius = ring.ring_radius * random.between(0.3, 0.42);
    const Blob& blob = organ.blobs[static_cast<std::size_t>(random.whole(0, blobs - 1))];
    const Vec3 on_sphere = random.direction();
    const Vec3 out = (blob.turn.transpose() * on_sphere.cwiseQuotient(blob.radii)).normalized();
    ring.centre = blob.centre + blob.turn.transpose() * blob.radii.cwiseProduct(on_sphere);
    // One half inside, the other a handle: its axis lies in the skin.
    const Vec3 axis = out.cross(random.direction()).normalized();
    ring.turn.row(2) = axis;
    ring.turn.row(0) = axis.unitOrthogonal();
    ring.turn.row(1) = axis.cross(axis.unitOrthogonal());
    organ.rings.push_back(ring);
  }
  for (const Blob& blob : organ.blobs) {
    const double reach = blob.radii.maxCoeff() + organ.fillet;
    organ.bounds.extend(blob.centre.array() - reach);
    organ.bounds.extend(blob.centre.array() + reach);
  }
  for (const Ring& ring : organ.rings) {
    const double reach = ring.ring_radius + ring.tube_radius + organ.fillet;
    organ.bounds.extend(ring.centre.array() - reach);
    organ.bounds.extend(ring.centre.array() + reach);
  }
  return organ;
}

/// With room for a layer of cells outside.
TriangleMesh surfaceOf(const Organ& organ, double cell, int relaxations) {
  Box bounds = organ.bounds;
  bounds.min.array() -= cell;
  bounds.max.array() += cell;
  return isosurface([&](const Vec3& p) { return organ.at(p); }, bounds, Vec3::Constant(cell), relaxations);
}

bool isSound(const TriangleMesh& mesh, int genus) {
  if (mesh.empty()) return false;
  const MeshReport report = inspectMesh(mesh);
  return report.closed() && report.components == 1 && report.self_intersections == 0 && report.signed_volume > 0.0 &&
         genusOf(mesh) == genus;
}

Error outside(const char* name, double value, const char* accepted) {
  std::ostringstream text;
  text << name << " is " << value << "; accepted: " << accepted;
  return {ErrorCode::kInvalidArgument, text.str()};
}

}  // namespace

int genusOf(const TriangleMesh& mesh) {
  std::vector<char> used(mesh.vertices.size(), 0);
  for (const Triangle& t : mesh.triangles)
    for (const Index v : t) used[v] = 1;
  const long vertices = std::count(used.begin(), used.end(), 1), faces = static_cast<long>(mesh.triangles.size());
  return static_cast<int>(1 - (vertices - faces / 2) / 2);
}

Result<TriangleMesh> randomOrgan(std::uint64_t seed, int genus, double size, std::size_t triangles) {
  if (!(genus >= 0 && genus <= 3)) return outside("genus", genus, "0 to 3");
  if (!(size >= 1e-3 && size <= 10.0)) return outside("size", size, "0.001 to 10 m");
  if (!(triangles >= 100 && triangles <= 200000))
    return outside("triangles", static_cast<double>(triangles), "100 to 200000");
  for (std::uint64_t attempt = 0; attempt < kTries; ++attempt) {
    const Organ organ = makeOrgan(Random(seed, attempt).bits(), genus);
    const double draft_cell = std::sqrt(kTrianglesPerCell * 2.0 / static_cast<double>(kDraft));
    const TriangleMesh draft = surfaceOf(organ, draft_cell, 2);
    if (draft.empty() || inspectMesh(draft, false).components != 1 || genusOf(draft) != genus) continue;
    double cell = std::sqrt(kTrianglesPerCell * surfaceArea(draft) / static_cast<double>(triangles));
    for (int refinement = 0; refinement < kRefinements; ++refinement, cell *= 0.85) {
      TriangleMesh mesh = surfaceOf(organ, cell, kRelaxations);
      if (!isSound(mesh, genus)) continue;
      const Box box = boundsOf(mesh.vertices);
      const double scale = size / (box.max - box.min).maxCoeff();
      for (Vec3& p : mesh.vertices) p = scale * (p - 0.5 * (box.min + box.max));
      return mesh;
    }
  }
  return Error{ErrorCode::kFailed, "no shape of seed " + std::to_string(seed) + " has the genus " +
                                       std::to_string(genus) + " in so many triangles"};
}

}  // namespace meshless
